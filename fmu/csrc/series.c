/* Recurrences for the coefficients of Taylor series, for the generated function that includes them.

   A slow value's coefficients are a row, of which the first k are known when the k-th is computed. The products of fast by slow
   values are gathered: the sums over all pairs of earlier coefficients are taken for all of them at once, two to a
   register, before the newest coefficients are known; these are added when they are. */

/* What the coefficients between the first and the k-th contribute to the k-th of a product, and of a square. */
static inline double slow_middle(const double *a, const double *b, int k)
{
    double sum = 0.0;
    for (int j = 1; j < k; j++) sum += a[j] * b[k - j];
    return sum;
}

static inline double slow_middle_square(const double *a, int k)
{
    double sum = 0.0;
    for (int j = 1; 2 * j < k; j++) sum += a[j] * a[k - j];
    sum *= 2.0;
    return k && k % 2 == 0 ? sum + a[k / 2] * a[k / 2] : sum;
}

static inline double slow_product(const double *a, const double *b, int k)
{
    return k ? slow_middle(a, b, k) + (a[0] * b[k] + a[k] * b[0]) : a[0] * b[0];
}

static inline double slow_square(const double *a, int k)
{
    return k ? slow_middle_square(a, k) + 2.0 * a[0] * a[k] : a[0] * a[0];
}

static inline double slow_quotient(double over, const double *under, const double *quotient, int k)
{
    const double inverse = 1.0 / under[0];
    return k ? (over - slow_middle(under, quotient, k) - under[k] * quotient[0]) * inverse : over * inverse;
}

static inline double slow_sqrt(const double *a, const double *root, int k)
{
    if (k == 0) return sqrt(a[0]);
    const double inverse = 0.5 / root[0];
    return (a[k] - slow_middle_square(root, k)) * inverse;
}

static inline double slow_exp(const double *a, const double *power, int k)
{
    if (k == 0) return exp(a[0]);
    double sum = 0.0;
    for (int j = 1; j <= k; j++) sum += j * a[j] * power[k - j];
    return sum * (1.0 / k);
}

static inline void slow_circle(const double *angle, double *sine, double *cosine, int k)
{
    if (k == 0) {
        sine[0] = sin(angle[0]), cosine[0] = cos(angle[0]);
        return;
    }
    double along = 0.0, across = 0.0;
    for (int j = 1; j <= k; j++) {
        along += j * angle[j] * cosine[k - j];
        across += j * angle[j] * sine[k - j];
    }
    sine[k] = along * (1.0 / k), cosine[k] = -across * (1.0 / k);
}

typedef union {
    double of[N_MIXED];
    Pair pairs[N_MIXED / 2];
} MixedRow;

typedef struct {
    MixedRow fast[TAYLOR_ORDER], slow[SLOW_ORDER + 1], sums;
} Mixed;

static ALWAYS_INLINE void sum_mixed(Mixed *mixed, int k)
{
    MixedRow sums = {{0.0}};
    for (int j = 1; j <= k && j <= SLOW_ORDER; j++)
        UNROLL for (int i = 0; i < N_MIXED / 2; i++)
            sums.pairs[i] = SUM(sums.pairs[i], PRODUCT(mixed->slow[j].pairs[i], mixed->fast[k - j].pairs[i]));
    mixed->sums = sums;
}

static ALWAYS_INLINE double mixed_of(Mixed *mixed, int k, int p, double a)
{
    mixed->fast[k].of[p] = a;
    return mixed->sums.of[p] + mixed->slow[0].of[p] * a;
}
