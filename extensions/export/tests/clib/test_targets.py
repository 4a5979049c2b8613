"""The product of 128 bits that exported WebAssembly has, against Python's integers."""

import ctypes
import random

from llvmlite import binding as llvm

from aloft.extensions.export.clib.targets import WIDE_PRODUCT


def test_the_wide_product_is_that_of_python() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    module = llvm.parse_assembly(WIDE_PRODUCT.replace("__multi3", "wide_product"))
    machine = llvm.Target.from_default_triple().create_target_machine()
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, *[ctypes.c_uint64] * 4)
    product, out = kind(engine.get_function_address("wide_product")), (ctypes.c_uint64 * 2)()
    draw = random.Random(1)
    for _ in range(2000):
        a, b = (draw.getrandbits(draw.choice((1, 33, 64, 100, 128))) for _ in "ab")
        product(ctypes.addressof(out), a & 2**64 - 1, a >> 64, b & 2**64 - 1, b >> 64)
        assert out[0] | out[1] << 64 == a * b % 2**128
