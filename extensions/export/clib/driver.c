/* Runs a library on the inputs of many ticks and writes its memory after each; `aloft export c --check`. */
#include <stdint.h>
#include <stdio.h>

#include "library.h"

static uint64_t memory[(LIB_MEMORY_SIZE + 7) / 8];
static union {
    lib_inputs inputs;
    unsigned char bytes[LIB_INPUT_SIZE];
} given;
static lib_outputs outputs;

int main(int count, char **arguments)
{
    FILE *from, *to;
    if (count != 3 || !(from = fopen(arguments[1], "rb")) || !(to = fopen(arguments[2], "wb")))
        return 2;
    if (lib_init(memory, sizeof memory) != 0)
        return 3;
    while (fread(given.bytes, 1, LIB_INPUT_SIZE, from) == LIB_INPUT_SIZE) {
        lib_step((LIB *)memory, &given.inputs, &outputs);
        if (fwrite(memory, 1, LIB_MEMORY_SIZE, to) != LIB_MEMORY_SIZE)
            return 4;
    }
    return fclose(to) ? 5 : 0;
}
