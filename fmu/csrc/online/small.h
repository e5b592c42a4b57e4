/* Algebra of 3-vectors and of small symmetric systems. */
#ifndef SMALL_H
#define SMALL_H

#include <math.h>

static const double NOTHING[3][3] = {{0}};

static void cross(const double a[3], const double b[3], double c[3]) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void times(const double A[3][3], const double b[3], double c[3]) {
    for (int i = 0; i < 3; i++) c[i] = dot(A[i], b);
}

static void transposed_times(const double A[3][3], const double b[3], double c[3]) {
    for (int i = 0; i < 3; i++) c[i] = A[0][i] * b[0] + A[1][i] * b[1] + A[2][i] * b[2];
}

static void product(const double A[3][3], const double B[3][3], double C[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) C[i][j] = A[i][0] * B[0][j] + A[i][1] * B[1][j] + A[i][2] * B[2][j];
}

/* -[p]x: by what a rotation vector moves a point at p. */
static void moved_by_turn(const double p[3], double C[3][3]) {
    C[0][0] = C[1][1] = C[2][2] = 0.0;
    C[0][1] = p[2], C[0][2] = -p[1];
    C[1][0] = -p[2], C[1][2] = p[0];
    C[2][0] = p[1], C[2][1] = -p[0];
}

/* Whether a symmetric matrix is positive definite. */
static int is_definite(const double A[3][3]) {
    double c00 = A[1][1] * A[2][2] - A[1][2] * A[2][1], c01 = A[0][2] * A[2][1] - A[0][1] * A[2][2],
           c02 = A[0][1] * A[1][2] - A[0][2] * A[1][1];
    return A[0][0] > 0.0 && A[0][0] * A[1][1] - A[0][1] * A[1][0] > 0.0 && A[0][0] * c00 + A[1][0] * c01 + A[2][0] * c02 > 0.0;
}

/* The inverses of L symmetric positive definite matrices, each number of one beside the same of the others; 0, and *sound, where one is none. */
static ALWAYS_INLINE void inverses(int L, const double *restrict A, double *restrict C, double *restrict sound) {
    for (int m = 0; m < L; m++) {
        const double a00 = A[m], a01 = A[L + m], a02 = A[2 * L + m], a10 = A[3 * L + m], a11 = A[4 * L + m], a12 = A[5 * L + m];
        const double a20 = A[6 * L + m], a21 = A[7 * L + m], a22 = A[8 * L + m];
        const double c00 = a11 * a22 - a12 * a21, c01 = a02 * a21 - a01 * a22, c02 = a01 * a12 - a02 * a11, c22 = a00 * a11 - a01 * a10;
        const double determinant = a00 * c00 + a10 * c01 + a20 * c02, by = 1.0 / determinant;
        const int is = (a00 > 0.0) & (c22 > 0.0) & (determinant > 0.0) & (by > 0.0) & (by < INFINITY);
        const double f = is ? by : 0.0;
        sound[m] = is ? 1.0 : 0.0;
        C[m] = f * c00, C[L + m] = C[3 * L + m] = f * c01, C[2 * L + m] = C[6 * L + m] = f * c02;
        C[4 * L + m] = f * (a00 * a22 - a02 * a20);
        C[5 * L + m] = C[7 * L + m] = f * (a02 * a10 - a00 * a12);
        C[8 * L + m] = f * c22;
    }
}

/* The inverse of a symmetric positive definite matrix; 0 if it is not one. */
static int inverted(const double A[3][3], double C[3][3]) {
    double found[9], sound;
    inverses(1, A[0], found, &sound);
    for (int k = 0; k < 9 && sound != 0.0; k++) C[k / 3][k % 3] = found[k];
    return sound != 0.0;
}

/* The inverse of a matrix by its cofactors; 0 if it has none. */
static int inverse_of(const double A[3][3], double C[3][3]) {
    double rows[3][3], determinant;
    for (int k = 0; k < 3; k++) cross(A[(k + 1) % 3], A[(k + 2) % 3], rows[k]);
    determinant = dot(A[0], rows[0]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) C[j][i] = rows[i][j] / determinant;
    return isfinite(1.0 / determinant);
}

/* Of a variance, what rounding may make of it in an update, and more: so much is added, and covariances stay definite. */
#define ROUNDING 1e-12

#define INDEFINITE 1e-13 /* what is left of a variance where others are known: less is rounding */

/* The lower Cholesky factor in place; 0 if there is none. */
static int factored(int n, double *A) {
    for (int j = 0; j < n; j++) {
        double d = A[j * n + j];
        for (int k = 0; k < j; k++) d -= A[j * n + k] * A[j * n + k];
        if (!(d > INDEFINITE * A[j * n + j])) return 0;
        d = sqrt(d);
        A[j * n + j] = d;
        const double inverse = 1.0 / d;
        for (int i = j + 1; i < n; i++) {
            double s = A[i * n + j];
            for (int k = 0; k < j; k++) s -= A[i * n + k] * A[j * n + k];
            A[i * n + j] = s * inverse;
        }
    }
    return 1;
}

/* L L' X = X in place, of `count` columns. */
static ALWAYS_INLINE void solved_all(int n, int count, const double *L, double *restrict X) {
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++)
            for (int j = 0; j < count; j++) X[i * count + j] -= L[i * n + k] * X[k * count + j];
        for (int j = 0; j < count; j++) X[i * count + j] /= L[i * n + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++)
            for (int j = 0; j < count; j++) X[i * count + j] -= L[k * n + i] * X[k * count + j];
        for (int j = 0; j < count; j++) X[i * count + j] /= L[i * n + i];
    }
}

/* L L' x = x in place. */
static void solved(int n, const double *L, double *x) { solved_all(n, 1, L, x); }

/* The inverse of a lower triangle in place. */
static void invert_triangle(int n, double *L) {
    for (int j = 0; j < n; j++) {
        L[n * j + j] = 1.0 / L[n * j + j];
        for (int i = j + 1; i < n; i++) {
            double sum = 0.0;
            for (int k = j; k < i; k++) sum += L[n * i + k] * L[n * k + j];
            L[n * i + j] = -sum / L[n * i + i];
        }
    }
}

/* L^-1 e in place, of a Cholesky factor L (3, 3): of variance 1 in all directions, if L L' is the covariance of e. */
static void whitened(const double L[9], double e[3]) {
    for (int k = 0; k < 3; k++) {
        for (int j = 0; j < k; j++) e[k] -= L[3 * k + j] * e[j];
        e[k] /= L[4 * k];
    }
}

/* The mean square distance of points from their centroid. */
static double mean_square(const double (*points)[3], int count) {
    double mean[3] = {0}, sum = 0.0;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) mean[k] += points[i][k] / count;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) sum += (points[i][k] - mean[k]) * (points[i][k] - mean[k]) / count;
    return sum;
}

#define SMALL 1e-3 /* square of an angle, rad2, or of a sine, below which five terms of a series are exact to rounding */

/* sin x / x by the square of a small x. */
static double sine_over(double square) { return 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0))); }

/* The rotation by a rotation vector (Rodrigues). */
static void rotation(const double turn[3], double C[3][3]) {
    double square = dot(turn, turn), s, half;
    if (square < SMALL) {
        s = sine_over(square), half = sine_over(0.25 * square);
    } else {
        const double angle = sqrt(square);
        s = sin(angle) / angle, half = sin(angle / 2.0) / (angle / 2.0);
    }
    double c = 0.5 * half * half;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) C[i][j] = c * turn[i] * turn[j] + (i == j ? 1.0 - c * square : 0.0);
    C[0][1] -= s * turn[2], C[1][0] += s * turn[2];
    C[0][2] += s * turn[1], C[2][0] -= s * turn[1];
    C[1][2] -= s * turn[0], C[2][1] += s * turn[0];
}

/* The quaternion (w, x, y, z) of a rotation, w >= 0: Shepperd (1978), the largest component first. */
static void quaternion_of(const double R[3][3], double q[4]) {
    double trace = R[0][0] + R[1][1] + R[2][2], best = trace, length = 0.0;
    int largest = 3;
    for (int i = 0; i < 3; i++)
        if (R[i][i] > best) best = R[i][i], largest = i;
    if (largest == 3) {
        q[0] = 1.0 + trace;
        q[1] = R[2][1] - R[1][2], q[2] = R[0][2] - R[2][0], q[3] = R[1][0] - R[0][1];
    } else {
        int i = largest, j = (i + 1) % 3, k = (i + 2) % 3;
        q[1 + i] = 1.0 + 2.0 * R[i][i] - trace;
        q[1 + j] = R[i][j] + R[j][i], q[1 + k] = R[i][k] + R[k][i];
        q[0] = R[k][j] - R[j][k];
    }
    for (int i = 0; i < 4; i++) length += q[i] * q[i];
    length = q[0] < 0.0 ? -sqrt(length) : sqrt(length);
    for (int i = 0; i < 4; i++) q[i] /= length;
}

static void matrix_of(const double q[4], double R[3][3]) {
    const double *v = q + 1;
    double w = q[0], square = dot(v, v);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) R[i][j] = 2.0 * v[i] * v[j] + (i == j ? w * w - square : 0.0);
    R[0][1] -= 2.0 * w * v[2], R[1][0] += 2.0 * w * v[2];
    R[0][2] += 2.0 * w * v[1], R[2][0] -= 2.0 * w * v[1];
    R[1][2] -= 2.0 * w * v[0], R[2][1] += 2.0 * w * v[0];
}

/* The rotation vector of a rotation. */
static void rotation_vector(const double R[3][3], double turn[3]) {
    double q[4];
    quaternion_of(R, q);
    double square = dot(q + 1, q + 1), factor;
    if (square < SMALL) { /* asin x / x */
        factor = 2.0 + square * (1.0 / 3.0 + square * (3.0 / 20.0 + square * (5.0 / 56.0 + square * (35.0 / 576.0 + square * (63.0 / 1408.0)))));
    } else {
        const double sine = sqrt(square);
        factor = 2.0 * atan2(sine, q[0]) / sine;
    }
    for (int i = 0; i < 3; i++) turn[i] = factor * q[1 + i];
}

/* A, made orthonormal. */
static void orthonormal(double A[3][3], double R[3][3]) {
    double x = 1.0 / sqrt(dot(A[0], A[0]));
    for (int i = 0; i < 3; i++) A[0][i] *= x;
    double along = dot(A[0], A[1]);
    for (int i = 0; i < 3; i++) A[1][i] -= along * A[0][i];
    double y = 1.0 / sqrt(dot(A[1], A[1]));
    for (int i = 0; i < 3; i++) A[1][i] *= y;
    cross(A[0], A[1], A[2]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) R[i][j] = A[i][j];
}

/* R = exp([turn]x) R, made orthonormal again. */
static void turn_left(const double turn[3], double R[3][3]) {
    double T[3][3], A[3][3];
    rotation(turn, T);
    product(T, R, A);
    orthonormal(A, R);
}

/* A = R T' */
static void by_transposed(const double R[3][3], const double T[3][3], double A[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) A[i][j] = dot(R[i], T[j]);
}

/* R = R T', made orthonormal again: the attitude of axes against which the body was turned by T. */
static void turn_axes(const double T[3][3], double R[3][3]) {
    double A[3][3];
    by_transposed(R, T, A);
    orthonormal(A, R);
}

/* The rotation vector in C from B to A, and its length. */
static double angle_between(const double A[3][3], const double B[3][3], double turn[3]) {
    double change[3][3];
    by_transposed(A, B, change);
    rotation_vector(change, turn);
    return sqrt(dot(turn, turn));
}

static void transposed(const double A[3][3], double C[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) C[j][i] = A[i][j];
}

static void scale_block(double *values, int count, double factor) {
    for (int k = 0; k < count; k++) values[k] *= factor;
}

static void copy(const double from[3][3], double to[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) to[i][j] = from[i][j];
}

#endif
