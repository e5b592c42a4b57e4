/* What goes beyond C11. Compilers without GNU's extensions make the same numbers, slower; so do all with -DPLAIN_C. */

#ifndef BARYSCOPE_DIALECT_H
#define BARYSCOPE_DIALECT_H

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "-ffast-math and -ffinite-math-only take away the checks for values that are not finite: compile without them"
#endif

#if defined(__GNUC__) && !defined(PLAIN_C) /* gcc, clang and zig */
#define ALWAYS_INLINE inline __attribute__((always_inline))
#define FLATTEN __attribute__((flatten))
#define SELDOM __attribute__((noinline, cold)) /* takes no registers from the loop that it is called in */
#define EXPORTED __attribute__((visibility("default")))
#define UNROLL _Pragma("GCC unroll 16")
#define PERHAPS_UNUSED __attribute__((unused))
/* CasADi writes for programs that ask for more of a function than units do. */
#define OTHERS_CODE \
    _Pragma("GCC diagnostic push") _Pragma("GCC diagnostic ignored \"-Wunused-function\"") _Pragma("GCC diagnostic ignored \"-Wunused-parameter\"")
#define OWN_CODE _Pragma("GCC diagnostic pop")
#define ALIGNED __attribute__((aligned(32))) /* as many numbers as are taken at once do not lie across two lines of a cache */

/* A function that spends its time in long rows is compiled twice, the second time for processors that take four numbers at once and write results
   elsewhere than over an operand, and the loader chooses: where it can, which is glibc, and where the compiler brings what asks the processor, which
   zig does not; nor where sanitizers would be asked before they are ready. Numbers are the same, as there still are no sums in another order and no
   two operations in one. */
#if defined(__gnu_linux__) && defined(__x86_64__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif

/* Two doubles in one register. With plain arrays gcc vectorises only some of them, at half the speed. */
typedef double Pair __attribute__((vector_size(2 * sizeof(double))));
#define PAIR(a, b) ((Pair){a, b})
#define SUM(a, b) ((a) + (b))
#define PRODUCT(a, b) ((a) * (b))
#define SCALED(a, factor) ((a) * (factor))
#define LANE(pair, i) (pair)[i]
#else
#define ALWAYS_INLINE inline
#define FLATTEN
#define SELDOM
#define EXPORTED
#define UNROLL
#define PERHAPS_UNUSED
#define OTHERS_CODE
#define OWN_CODE
#define ALIGNED
#define WIDE

typedef struct {
    double of[2];
} Pair;
static inline Pair PAIR(double a, double b) { return (Pair){{a, b}}; }
static inline Pair SUM(Pair a, Pair b) { return PAIR(a.of[0] + b.of[0], a.of[1] + b.of[1]); }
static inline Pair PRODUCT(Pair a, Pair b) { return PAIR(a.of[0] * b.of[0], a.of[1] * b.of[1]); }
static inline Pair SCALED(Pair a, double factor) { return PAIR(a.of[0] * factor, a.of[1] * factor); }
#define LANE(pair, i) (pair).of[i]
#endif

#endif
