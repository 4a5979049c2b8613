/* The product that most of a Riccati step is made of, for BLASFEO's panels of four rows:
 *
 *     D = alpha A B' + beta C,   A and B 4 x n, C and D 4 x 4, every column four numbers in a row.
 *
 * BLASFEO has the same function, and in CasADi's packages it is the one for any processor, which
 * handles one number at a time. Here a column is one vector. Every sum is taken in the same order
 * and no product is fused with a sum, so the result has the same bits on every processor.
 */
typedef double column __attribute__((vector_size(32), aligned(8), may_alias));

#define EACH(x) ((column){(x), (x), (x), (x)})

static inline __attribute__((always_inline)) void product(
    int count, const double *alpha, const double *a, const double *b,
    const double *beta, const double *c, double *d)
{
    const column *left = (const column *)a;
    column sum0 = EACH(0.0), sum1 = sum0, sum2 = sum0, sum3 = sum0;
    for (int k = 0; k < count; ++k, b += 4) {
        const column rows = left[k];
        sum0 += rows * EACH(b[0]);
        sum1 += rows * EACH(b[1]);
        sum2 += rows * EACH(b[2]);
        sum3 += rows * EACH(b[3]);
    }
    const column scale = EACH(*alpha), share = EACH(*beta);
    const column *given = (const column *)c;
    /* All are read before one is written: D may be C. */
    sum0 = share * given[0] + scale * sum0;
    sum1 = share * given[1] + scale * sum1;
    sum2 = share * given[2] + scale * sum2;
    sum3 = share * given[3] + scale * sum3;
    column *found = (column *)d;
    found[0] = sum0;
    found[1] = sum1;
    found[2] = sum2;
    found[3] = sum3;
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) static void with_avx2(
    int count, const double *alpha, const double *a, const double *b,
    const double *beta, const double *c, double *d)
{
    product(count, alpha, a, b, beta, c, d);
}
#endif

void kernel_dgemm_nt_4x4_lib4(
    int count, const double *alpha, const double *a, const double *b,
    const double *beta, const double *c, double *d)
{
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        with_avx2(count, alpha, a, b, beta, c, d);
        return;
    }
#endif
    product(count, alpha, a, b, beta, c, d);
}
