#include "maths.h"
#include "stepped_sine.h"

/* Fewest periods in a reading: with them the Hann window leaves 1e-4 of an offset. */
#define LEAST_PERIODS 8.0
/* The largest factor by which a try changes the command. */
#define LARGEST_FACTOR 4.0

static uint64_t samples_of(const held *controller, double time_s)
{
    return (uint64_t)round_up(time_s * controller->spec.rate_hz);
}

static double frequency_hz(const held *controller)
{
    const size_t last = controller->spec.points - 1;
    return controller->spec.frequencies_hz[controller->reached < last ? controller->reached : last];
}

static double cycles_at(const held *controller, uint64_t n)
{
    const double samples = (double)(n - controller->phase_sample);
    const double cycles = controller->phase_cycles + frequency_hz(controller) * (samples / controller->spec.rate_hz);
    return cycles - (double)(int32_t)cycles;
}

/* Ramps the command to this amplitude from sample n on; the reading begins when it has settled. */
static void go_to(held *controller, uint64_t n, double to_n)
{
    const double hz = frequency_hz(controller);
    double periods = round_up(controller->spec.window_s * hz);
    periods = periods < LEAST_PERIODS ? LEAST_PERIODS : periods;
    controller->ramp_from = n;
    controller->from_n = controller->to_n;
    controller->to_n = to_n;
    controller->window_first = n + samples_of(controller, controller->spec.ramp_s + controller->spec.settle_s) + 1;
    controller->window_end = controller->window_first + (uint64_t)(periods * controller->spec.rate_hz / hz + 0.5);
    controller->has_gap = false;
    controller->is_clipped = false;
    controller->sum_cosine = 0.0;
    controller->sum_sine = 0.0;
    controller->sum_weight = 0.0;
}

/* Raised cosine from one amplitude to the next. */
static double amplitude_at(const held *controller, uint64_t n)
{
    const double fraction = (double)(n - controller->ramp_from) / (controller->spec.ramp_s * controller->spec.rate_hz);
    if (!(fraction < 1.0)) {
        return controller->to_n;
    }
    const double way = 0.5 * (1.0 - cosine_of_cycles(0.5 * fraction));
    return controller->from_n + (controller->to_n - controller->from_n) * way;
}

/* Adds a reading to the sums of w f cos, w f sin and w, with the Hann window w = (1 - cos(2 pi (k + 1/2)/N))/2. */
static void read_head(held *controller, const resonarm_sample *sample)
{
    const uint64_t n = sample->sample;
    if (n < controller->window_first || n >= controller->window_end) {
        return;
    }
    const double length = (double)(controller->window_end - controller->window_first);
    const double place = (double)(n - controller->window_first) + 0.5;
    const double weight = 0.5 * (1.0 - cosine_of_cycles(place / length));
    const double cycles = cycles_at(controller, n);
    controller->has_gap |= n != controller->last_sample + 1;
    controller->is_clipped |= sample->head.x_saturated;
    controller->sum_cosine += weight * sample->head.force_x_n * cosine_of_cycles(cycles);
    controller->sum_sine += weight * sample->head.force_x_n * sine_of_cycles(cycles);
    controller->sum_weight += weight;
}

static double force_read(const held *controller)
{
    const double a = controller->sum_cosine / controller->sum_weight;
    const double b = controller->sum_sine / controller->sum_weight;
    return 2.0 * square_root(a * a + b * b);
}

/* Continues with the next frequency in phase; after the last one ramps down to zero. */
static void next_frequency(held *controller, uint64_t n, double force_n)
{
    controller->points[controller->reached] = (held_point){
        .frequency_hz = frequency_hz(controller),
        .command_n = controller->to_n,
        .force_n = force_n,
        .tries = controller->tries,
        .first_sample = controller->window_first,
        .end_sample = controller->window_end,
    };
    controller->phase_cycles = cycles_at(controller, n);
    controller->phase_sample = n;
    controller->reached++;
    controller->tries = 1;
    go_to(controller, n, controller->reached < controller->spec.points ? controller->to_n : 0.0);
}

/* Sets the command for the wanted force, or returns why there is none. */
static held_reason correct(held *controller, uint64_t n, double force_n)
{
    const double wanted_n = controller->spec.amplitude_n;
    if (!(force_n > wanted_n * 1e-6)) {
        return HELD_NO_FORCE;
    }
    if (controller->tries == STEPPED_SINE_TRIES) {
        return HELD_NOT_SETTLED;
    }
    double factor = wanted_n / force_n;
    factor = factor > LARGEST_FACTOR ? LARGEST_FACTOR : factor;
    factor = factor < 1.0 / LARGEST_FACTOR ? 1.0 / LARGEST_FACTOR : factor;
    if (controller->to_n * factor > controller->spec.limit_n) {
        return HELD_LIMIT;
    }
    controller->tries++;
    go_to(controller, n, controller->to_n * factor);
    return HELD_NOT_GIVEN_UP;
}

/* Evaluates a finished reading; one with a gap is repeated. */
static held_reason judge(held *controller, uint64_t n)
{
    const double wanted_n = controller->spec.amplitude_n;
    if (controller->is_clipped) {
        return HELD_CLIPPED;
    }
    if (controller->has_gap || !(controller->sum_weight > 0.0)) {
        if (controller->tries == STEPPED_SINE_TRIES) {
            return HELD_NOT_SETTLED;
        }
        controller->tries++;
        go_to(controller, n, controller->to_n);
        return HELD_NOT_GIVEN_UP;
    }
    const double force_n = force_read(controller);
    const double error_n = force_n > wanted_n ? force_n - wanted_n : wanted_n - force_n;
    if (error_n <= STEPPED_SINE_TOLERANCE * wanted_n) {
        next_frequency(controller, n, force_n);
        return HELD_NOT_GIVEN_UP;
    }
    return correct(controller, n, force_n);
}

void held_init(held *controller, const stepped_sine_spec *spec)
{
    *controller = (held){.spec = *spec, .tries = 1};
    go_to(controller, 0, spec->amplitude_n);
}

resonarm_answer held_answer(void *context, const resonarm_sample *sample)
{
    held *controller = context;
    const uint64_t n = sample->sample;
    const bool is_ending = controller->reached == controller->spec.points;
    if (is_ending && n >= controller->ramp_from + samples_of(controller, controller->spec.ramp_s)) {
        return (resonarm_answer){.action = RESONARM_FINISH};
    }
    if (!is_ending) {
        read_head(controller, sample);
        if (n >= controller->window_end) {
            controller->reason = judge(controller, n);
        }
    }
    controller->last_sample = n;
    if (controller->reason != HELD_NOT_GIVEN_UP) {
        return (resonarm_answer){.action = RESONARM_GIVE_UP};
    }
    const double force_x_n = amplitude_at(controller, n) * sine_of_cycles(cycles_at(controller, n));
    return (resonarm_answer){.action = RESONARM_HOLD_FORCE, .force_x_n = force_x_n};
}
