/* A swept-sine controller that knows nothing of Resonarm: C99, SocketCAN, and the messages of bench.dbc.
 *
 *     cc -O2 -std=gnu99 -Wall -Wextra -o sine sine.c -lm
 *     ./sine vcan0 20 45 1 3
 *
 * The arguments are the bus, the first and the last frequency in Hz, the rate in octaves a minute, and the acceleration in
 * m/s2. The controller answers each reading with a drive. First it listens, then it checks the loop with a small sine, then it
 * sweeps with its amplitude held by feedback. It ramps the drive to zero and disables the shaker at the end, and when the
 * reading is lost, too large, or clipped.
 */
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <math.h>
#include <net/if.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#define RATE_HZ 1000.0
#define PI 3.14159265358979323846

/* Messages and signals of bench.dbc. */
enum { DRIVE_ID = 0x100, MEAS_ID = 0x200 };
static const double FORCE_N = 0.02, ACCELERATION_M_S2 = 0.005, MOST_N = 600.0;

/* Times in samples. */
enum { SILENCE = 1000, CHECK = 2000, RISE = 2000, SETTLE = 1000, RAMP = 50, TOO_HIGH = 20, LOST = 100, STUCK = 50, CLIPPED = 5 };

static const double CHECK_N = 5.0;       /* amplitude of the sine of the loop check */
static const double LEAST_RATIO = 3.0;   /* rms of the loop check over that of the silence, at least */
static const double GAIN = 4.0;          /* of the loop, 1/s: below 2 zeta omega of the lightest mode */
static const double MOST_DB_S = 60.0;    /* fastest change of the drive */
static const double TRACKING = 0.15;     /* bandwidth of the filter over the frequency */

enum phase { LISTENING, CHECKING, SWEEPING, RAMPING, OVER };

struct reading {
    double control_m_s2;
    bool enabled, clipped;
};

struct controller {
    double from_hz, rate_oct_s, sweep_s, level_m_s2; /* what is specified */
    enum phase phase;
    long sample;              /* since the phase began */
    double silence, response; /* sums of squares */
    double complex_re[2], complex_im[2]; /* tracking filter: two poles, of the reading turned back by the phase */
    double drive_n;           /* amplitude */
    double phase_rad;
    int too_high, lost, stuck, clipped;
    double last_m_s2;
    const char *reason;       /* why it stopped early */
};

static void enter(struct controller *c, enum phase phase)
{
    c->phase = phase;
    c->sample = 0;
}

static void stop(struct controller *c, const char *reason)
{
    c->reason = reason;
    enter(c, RAMPING);
}

/* Frequency, Hz, and phase, rad, at a time of the sweep: f = f0 2^(r t), theta = 2 pi f0 (2^(r t) - 1)/(r ln 2). */
static double frequency_hz(const struct controller *c, double t_s)
{
    return c->from_hz * exp2(c->rate_oct_s * t_s);
}

static double phase_rad(const struct controller *c, double t_s)
{
    return 2.0 * PI * c->from_hz * (exp2(c->rate_oct_s * t_s) - 1.0) / (c->rate_oct_s * log(2.0));
}

/* Amplitude of the reading at the frequency of the sine. */
static double tracked(struct controller *c, double reading, double hz)
{
    double weight = 1.0 - exp(-2.0 * PI * TRACKING * hz / RATE_HZ);
    double re = reading * cos(c->phase_rad), im = -reading * sin(c->phase_rad);
    for (int k = 0; k < 2; k++) {
        c->complex_re[k] += (re - c->complex_re[k]) * weight;
        c->complex_im[k] += (im - c->complex_im[k]) * weight;
        re = c->complex_re[k];
        im = c->complex_im[k];
    }
    return 2.0 * hypot(re, im);
}

/* The drive, N, that answers a sample of the sweep. */
static double sweep(struct controller *c, const struct reading *r)
{
    double before = RISE + SETTLE, t_s = (c->sample - before) / RATE_HZ;
    double hz = frequency_hz(c, t_s > 0.0 ? t_s : 0.0);
    double amplitude = tracked(c, r->control_m_s2, hz);
    /* The level rises by 20 dB before the sweep. */
    double rise = c->sample < RISE ? pow(10.0, (double)c->sample / RISE - 1.0) : 1.0;
    double level = c->level_m_s2 * rise;
    bool seen = c->sample > RISE / 2; /* the filter has seen the sine */
    if (seen) {
        double change = GAIN * log(level / fmax(amplitude, 1e-9));
        double most = MOST_DB_S * log(10.0) / 20.0;
        c->drive_n *= exp(fmax(-most, fmin(most, change)) / RATE_HZ);
        c->too_high = amplitude > 2.0 * level ? c->too_high + 1 : 0;
        c->lost = amplitude < 0.25 * level ? c->lost + 1 : 0;
    }
    c->stuck = r->control_m_s2 == c->last_m_s2 ? c->stuck + 1 : 0;
    c->clipped = r->clipped ? c->clipped + 1 : 0;
    c->last_m_s2 = r->control_m_s2;
    if (c->drive_n > MOST_N)
        stop(c, "the drive would exceed its limit");
    else if (c->too_high > TOO_HIGH)
        stop(c, "the reading is too large");
    else if (c->lost > LOST || c->stuck > STUCK)
        stop(c, "the reading is lost");
    else if (c->clipped > CLIPPED)
        stop(c, "the reading is clipped");
    else if (t_s >= c->sweep_s)
        enter(c, RAMPING);
    c->phase_rad = t_s > 0.0 ? phase_rad(c, t_s) : 2.0 * PI * c->from_hz * t_s;
    return c->drive_n * cos(c->phase_rad);
}

/* The drive, N, that answers a reading. */
static double answer(struct controller *c, const struct reading *r)
{
    double square = r->control_m_s2 * r->control_m_s2;
    c->sample++;
    switch (c->phase) {
    case LISTENING:
        c->silence += square;
        if (c->sample == SILENCE)
            enter(c, CHECKING);
        return 0.0;
    case CHECKING: {
        /* The first half lets the structure settle. */
        if (c->sample > CHECK / 2)
            c->response += square;
        if (c->sample == CHECK) {
            double silence = sqrt(c->silence / SILENCE), response = sqrt(c->response / (CHECK / 2));
            if (response < LEAST_RATIO * silence || response == 0.0) {
                stop(c, "the sensor does not read the drive");
                c->drive_n = 0.0;
                return 0.0;
            }
            /* The sweep begins 20 dB below the level. */
            c->drive_n = 0.1 * c->level_m_s2 * CHECK_N / (response * sqrt(2.0));
            enter(c, SWEEPING);
        }
        return CHECK_N * fmin(1.0, c->sample / 500.0) * sin(2.0 * PI * c->from_hz * c->sample / RATE_HZ);
    }
    case SWEEPING:
        return sweep(c, r);
    case RAMPING: {
        double left = 1.0 - (double)c->sample / RAMP;
        c->phase_rad += 2.0 * PI * c->from_hz / RATE_HZ;
        if (left <= 0.0)
            enter(c, OVER);
        return c->drive_n * fmax(left, 0.0) * cos(c->phase_rad);
    }
    default:
        return 0.0;
    }
}

static int open_bus(const char *name)
{
    int bus = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    struct ifreq request = {0};
    struct can_filter filter = {.can_id = MEAS_ID, .can_mask = CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG};
    struct timeval timeout = {.tv_sec = 10};
    struct sockaddr_can address = {.can_family = AF_CAN};
    snprintf(request.ifr_name, sizeof request.ifr_name, "%s", name);
    if (bus < 0 || ioctl(bus, SIOCGIFINDEX, &request) < 0)
        return -1;
    address.can_ifindex = request.ifr_ifindex;
    setsockopt(bus, SOL_CAN_RAW, CAN_RAW_FILTER, &filter, sizeof filter);
    setsockopt(bus, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
    return bind(bus, (struct sockaddr *)&address, sizeof address) < 0 ? -1 : bus;
}

static int16_t little_endian(const uint8_t *bytes)
{
    return (int16_t)(bytes[0] | bytes[1] << 8);
}

/* The next reading; false after the timeout. */
static bool receive(int bus, struct reading *r)
{
    struct can_frame frame;
    ssize_t got;
    do {
        /* A process that is stopped and continued is woken from a read with a timeout, and begins it again. */
        got = read(bus, &frame, sizeof frame);
        if (got < 0 && errno != EINTR)
            return false;
    } while (got != sizeof frame || frame.can_dlc != 8);
    r->control_m_s2 = little_endian(frame.data) * ACCELERATION_M_S2;
    r->enabled = frame.data[4] & 1;
    r->clipped = frame.data[4] & 2;
    return true;
}

static bool drive(int bus, double force_n, bool enable)
{
    static uint8_t alive;
    double limited_n = fmax(-MOST_N, fmin(MOST_N, force_n));
    int16_t counts = (int16_t)lrint(limited_n / FORCE_N);
    struct can_frame frame = {.can_id = DRIVE_ID, .can_dlc = 4};
    frame.data[0] = counts & 0xFF;
    frame.data[1] = counts >> 8 & 0xFF;
    frame.data[2] = enable;
    frame.data[3] = alive++;
    return write(bus, &frame, sizeof frame) == sizeof frame;
}

int main(int argc, char **argv)
{
    struct controller c = {.phase = LISTENING};
    struct reading r = {0};
    if (argc != 6) {
        fprintf(stderr, "usage: sine BUS FROM_HZ TO_HZ OCTAVES_PER_MINUTE M_S2\n");
        return 2;
    }
    c.from_hz = atof(argv[2]);
    c.rate_oct_s = atof(argv[4]) / 60.0;
    c.level_m_s2 = atof(argv[5]);
    if (!(c.from_hz > 0.0 && atof(argv[3]) > c.from_hz && c.rate_oct_s > 0.0 && c.level_m_s2 > 0.0)) {
        fprintf(stderr, "the frequencies must rise; the rate and the level must be positive\n");
        return 2;
    }
    c.sweep_s = log2(atof(argv[3]) / c.from_hz) / c.rate_oct_s;
    int bus = open_bus(argv[1]);
    if (bus < 0) {
        perror(argv[1]);
        return 1;
    }
    /* Readings from before the shaker is enabled are not answered: the shaker repeats them. */
    drive(bus, 0.0, true);
    while (c.phase != OVER && receive(bus, &r)) {
        if (!r.enabled) {
            if (c.sample > 0 || c.phase != LISTENING) {
                fprintf(stderr, "the shaker was disabled\n");
                return 1;
            }
            continue;
        }
        double force_n = answer(&c, &r);
        if (!drive(bus, force_n, c.phase != OVER)) {
            perror(argv[1]);
            return 1;
        }
    }
    if (c.phase != OVER) {
        fprintf(stderr, "no reading for 10 s\n");
        return 1;
    }
    if (c.reason)
        fprintf(stderr, "stopped: %s\n", c.reason);
    return c.reason != NULL;
}
