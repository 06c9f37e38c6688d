/* Scene A as a plain loop: a random walk in the unit sphere, for how fast this machine could go.
 *
 *     walk PATHS SEED
 *
 * prints one JSON object. A pool of lanes takes one flight after the other, structure of arrays, without branches, so
 * that the compiler makes vector code of it; lanes whose path has ended are then filled from a queue of new paths,
 * which are aimed a pool at a time. Nothing here is general: one sphere, one grey medium, one constant environment of
 * radiance 1, no image (only the mean), and a small random number generator with a state in each lane.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { LANES = 256, MAX_DEPTH = 64, ROULETTE_DEPTH = 5 };

static const float SIGMA_T = 2.5f, ALBEDO = 0.8f, G = 0.5f;
/* The camera of scene A: at z = 4, and sees a square of side 2.5 at the origin. */
static const float DISTANCE = 4.0f, WINDOW = 2.5f;

typedef struct {
    float px[LANES], py[LANES], pz[LANES], dx[LANES], dy[LANES], dz[LANES], weight[LANES];
    int32_t depth[LANES];
} Paths;

typedef struct {
    uint32_t x[LANES], y[LANES], z[LANES], w[LANES];
} Random;

/* xorshift128 of Marsaglia 2003. */
static inline uint32_t next_bits(Random *random, int i) {
    uint32_t t = random->x[i] ^ (random->x[i] << 11), w = random->w[i];
    random->x[i] = random->y[i];
    random->y[i] = random->z[i];
    random->z[i] = w;
    return random->w[i] = w ^ (w >> 19) ^ t ^ (t >> 8);
}

/* In (0, 1]. */
static inline float to_uniform(uint32_t bits) { return (float)(int32_t)((bits >> 8) + 1) * 0x1p-24f; }

static inline float as_float(uint32_t bits) {
    float value;
    memcpy(&value, &bits, 4);
    return value;
}

static inline uint32_t as_bits(float value) {
    uint32_t bits;
    memcpy(&bits, &value, 4);
    return bits;
}

/* -ln(x) for 0 < x <= 1: exponent, and an atanh series of the mantissa in [sqrt(1/2), sqrt(2)). */
static inline float minus_log(float x) {
    int32_t e = (int32_t)(as_bits(x) - 0x3f3504f3u) >> 23;
    float m = as_float(as_bits(x) - ((uint32_t)e << 23));
    float f = (m - 1.0f) / (m + 1.0f), f2 = f * f;
    float series = f * (2.0f + f2 * (0.66666667f + f2 * (0.4f + f2 * (0.28571429f + f2 * 0.22222222f))));
    return -(series + (float)e * 0.69314718f);
}

/* Cosine and sine of 2 pi u for u in (0, 1]: a quadrant, and polynomials of the rest. */
static inline void circle(float u, float *cosine, float *sine) {
    float quadrant = floorf(4.0f * u + 0.5f), x = (4.0f * u - quadrant) * 1.57079633f, x2 = x * x;
    int32_t q = (int32_t)quadrant;
    float s = x * (1.0f + x2 * (-0.16666667f + x2 * (0.0083333333f - x2 * 0.00019841270f)));
    float c = 1.0f + x2 * (-0.5f + x2 * (0.041666667f + x2 * (-0.0013888889f + x2 * 0.000024801587f)));
    float a = (q & 1) ? s : c, b = (q & 1) ? c : s;
    *cosine = ((q + 1) & 2) ? -a : a;
    *sine = (q & 2) ? -b : b;
}

/* One flight of every lane; `ended` says which paths are over. What leaves adds to `radiance`, what scatters to
 * `events`. */
static void fly(Paths *restrict p, Random *restrict random, int32_t *restrict ended, float *restrict radiance,
                int32_t *restrict events) {
    for (int i = 0; i < LANES; i++) {
        uint32_t bits0 = next_bits(random, i), bits1 = next_bits(random, i), bits2 = next_bits(random, i);
        float px = p->px[i], py = p->py[i], pz = p->pz[i], dx = p->dx[i], dy = p->dy[i], dz = p->dz[i];
        float along = px * dx + py * dy + pz * dz, beyond = px * px + py * py + pz * pz - 1.0f;
        float root = sqrtf(fmaxf(along * along - beyond, 0.0f));
        float t = minus_log(to_uniform(bits0)) * (1.0f / SIGMA_T);
        int32_t alive = p->depth[i] >= 0, scatters = alive & (t < root - along);
        radiance[i] += (alive & !scatters) ? p->weight[i] : 0.0f;
        events[i] += scatters;
        px += t * dx;
        py += t * dy;
        pz += t * dz;

        float k = (1.0f - G * G) / (1.0f - G + 2.0f * G * to_uniform(bits1));
        float cos_theta = (1.0f + G * G - k * k) * (0.5f / G), cos_phi, sin_phi;
        float sin_theta = sqrtf(fmaxf(1.0f - cos_theta * cos_theta, 0.0f));
        circle(to_uniform(bits2), &cos_phi, &sin_phi);
        float u = sin_theta * cos_phi, v = sin_theta * sin_phi;
        /* The frame of Duff et al. 2017. */
        float sign = copysignf(1.0f, dz), a = -1.0f / (sign + dz), b = dx * dy * a;
        float nx = u * (1.0f + sign * dx * dx * a) + v * b + cos_theta * dx;
        float ny = u * sign * b + v * (sign + dy * dy * a) + cos_theta * dy;
        float nz = -u * sign * dx - v * dy + cos_theta * dz;

        float weight = p->weight[i] * ALBEDO;
        int32_t depth = p->depth[i] + 1;
        int32_t plays = depth > ROULETTE_DEPTH;
        /* The low bits of the words that made the direction: independent of it. */
        float xi = (float)(int32_t)(((bits1 & 255u) << 16) | ((bits2 & 255u) << 8) | (bits0 & 255u)) * 0x1p-24f;
        int32_t survives = scatters & (!plays | (xi < weight)) & (depth <= MAX_DEPTH);
        p->weight[i] = plays ? 1.0f : weight;
        p->px[i] = px;
        p->py[i] = py;
        p->pz[i] = pz;
        p->dx[i] = nx;
        p->dy[i] = ny;
        p->dz[i] = nz;
        p->depth[i] = survives ? depth : -1;
        ended[i] = !survives;
    }
}

/* New paths where their rays enter the sphere; `hits` says which do. */
static void aim(Paths *restrict p, Random *restrict random, int32_t *restrict hits) {
    for (int i = 0; i < LANES; i++) {
        uint32_t bits0 = next_bits(random, i), bits1 = next_bits(random, i);
        float x = (to_uniform(bits0) - 0.5f) * WINDOW, y = (to_uniform(bits1) - 0.5f) * WINDOW;
        float scale = 1.0f / sqrtf(x * x + y * y + DISTANCE * DISTANCE);
        float dx = x * scale, dy = y * scale, dz = -DISTANCE * scale;
        float along = DISTANCE * dz, discriminant = along * along - (DISTANCE * DISTANCE - 1.0f);
        float t = -along - sqrtf(fmaxf(discriminant, 0.0f));
        hits[i] = discriminant > 0.0f;
        p->px[i] = t * dx;
        p->py[i] = t * dy;
        p->pz[i] = DISTANCE + t * dz;
        p->dx[i] = dx;
        p->dy[i] = dy;
        p->dz[i] = dz;
        p->weight[i] = 1.0f;
        p->depth[i] = 0;
    }
}

static int list_of(const int32_t *restrict flags, int32_t *restrict list) {
    int n = 0;
    for (int i = 0; i < LANES; i++) {
        list[n] = i;
        n += flags[i];
    }
    return n;
}

static void seed_random(Random *random, uint64_t seed) {
    uint32_t *words = (uint32_t *)random;
    for (size_t i = 0; i < sizeof(Random) / 4; i++) { /* splitmix64 */
        uint64_t z = (seed += 0x9e3779b97f4a7c15u);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
        words[i] = (uint32_t)((z ^ (z >> 31)) >> 16);
    }
}

static double cpu_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(int argc, char **argv) {
    static Paths pool, queue;
    static Random random;
    static int32_t ended[LANES], hits[LANES], idle[LANES], ready[LANES + 1], events[LANES];
    static float radiance[LANES];
    long long paths = argc > 1 ? atoll(argv[1]) : 1 << 22, begun = 0, event_count = 0;
    int waiting = 0;
    double sum = 0.0, start = cpu_seconds();
    seed_random(&random, argc > 2 ? (uint64_t)atoll(argv[2]) : 0u);
    for (int i = 0; i < LANES; i++) {
        pool.depth[i] = -1;
        pool.dz[i] = 1.0f;
        ended[i] = 1;
    }
    for (int round = 0, busy = 1; busy; round++) {
        int n = list_of(ended, idle);
        busy = n < LANES;
        for (int k = 0; k < n; k++) {
            while (waiting == 0 && begun < paths) { /* Camera rays that miss bring the environment's 1. */
                aim(&queue, &random, hits);
                waiting = list_of(hits, ready);
                begun += LANES;
                sum += LANES - waiting;
            }
            if (waiting == 0) break;
            int from = ready[--waiting], to = idle[k];
            pool.px[to] = queue.px[from];
            pool.py[to] = queue.py[from];
            pool.pz[to] = queue.pz[from];
            pool.dx[to] = queue.dx[from];
            pool.dy[to] = queue.dy[from];
            pool.dz[to] = queue.dz[from];
            pool.weight[to] = 1.0f;
            pool.depth[to] = 0;
            busy = 1;
        }
        fly(&pool, &random, ended, radiance, events);
        if (round % 1024 == 0 || !busy) { /* Before the floats lose digits. */
            for (int i = 0; i < LANES; i++) {
                sum += radiance[i];
                event_count += events[i];
                radiance[i] = 0.0f;
                events[i] = 0;
            }
        }
    }
    printf("{\"paths\": %lld, \"events\": %lld, \"mean\": %.9g, \"cpu_seconds\": %.9g}\n", begun, event_count,
           sum / (double)begun, cpu_seconds() - start);
    return 0;
}
