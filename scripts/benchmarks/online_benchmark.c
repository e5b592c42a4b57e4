/* Time of one online_update as flight software in C sees it; run by benchmark.py.

   online_benchmark LIBRARY FRAMES RUNS: prints for each frame the least nanoseconds of so many runs, and whether the
   tumble is known then. FRAMES is a file of 64-bit numbers: the counts of frames, of features, and of the bytes of
   OnlineOptions, OnlineThrust and OnlineTumble; the options; and for each frame its time, the thrust, and x, y, z of
   each feature. */

#define _POSIX_C_SOURCE 199309L
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

typedef unsigned long long Size(void);
typedef void Start(void *, const void *);
typedef int Update(void *, double, int, const long long *, const double *, const double *, const void *);
typedef int TumbleAt(void *, double, void *);

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

int main(int argc, char **argv)
{
    if (argc != 4) return 2;
    void *library = dlopen(argv[1], RTLD_NOW);
    FILE *file = fopen(argv[2], "rb");
    long long counts[5];
    if (!library || !file || fread(counts, sizeof counts, 1, file) != 1) return 2;
    const long long frames = counts[0], features = counts[1];
    const size_t of_thrust = (size_t)counts[3], row = sizeof(double) + of_thrust + (size_t)features * 3 * sizeof(double);
    unsigned char *options = malloc((size_t)counts[2]), *rows = malloc((size_t)frames * row), *tumble = malloc((size_t)counts[4]);
    if (fread(options, (size_t)counts[2], 1, file) != 1) return 2;
    if (fread(rows, row, (size_t)frames, file) != (size_t)frames) return 2;
    Start *start = (Start *)dlsym(library, "online_start");
    Update *update = (Update *)dlsym(library, "online_update");
    TumbleAt *tumble_at = (TumbleAt *)dlsym(library, "online_tumble");
    void *memory = malloc(((Size *)dlsym(library, "online_size"))());
    long long *names = malloc((size_t)features * sizeof *names);
    double *least = malloc((size_t)frames * sizeof *least), *known = malloc((size_t)frames * sizeof *known);
    for (long long i = 0; i < features; i++) names[i] = i;
    for (int run = 0; run < atoi(argv[3]); run++) {
        start(memory, options);
        for (long long k = 0; k < frames; k++) {
            const unsigned char *frame = rows + (size_t)k * row;
            const double time = *(const double *)frame, *points = (const double *)(frame + sizeof time + of_thrust);
            const double begin = now();
            if (update(memory, time, (int)features, names, points, NULL, frame + sizeof time)) return 1;
            const double taken = now() - begin;
            if (!run || taken < least[k]) least[k] = taken;
            tumble_at(memory, time, tumble);
            known[k] = *(const double *)tumble;
        }
    }
    for (long long k = 0; k < frames; k++) printf("%.0f %d\n", least[k], known[k] != 0.0);
    return 0;
}
