#include "maths.h"
#include "stepped_sine.h"

static bool is_within(double value, double min, double max)
{
    return value >= min && value <= max;
}

stepped_sine_check stepped_sine_check_spec(const stepped_sine_spec *spec)
{
    if (!is_within(spec->rate_hz, 1.0, 65535.0)) {
        return STEPPED_SINE_BAD_RATE;
    }
    if (spec->points == 0 || spec->points > STEPPED_SINE_POINTS) {
        return STEPPED_SINE_BAD_POINTS;
    }
    double length_s = 0.0;
    for (size_t i = 0; i < spec->points; i++) {
        const double hz = spec->frequencies_hz[i];
        if (!is_within(hz, 1e-3, spec->rate_hz / 12.0)) {
            return STEPPED_SINE_BAD_FREQUENCY;
        }
        length_s += spec->dwell_s;
    }
    if (!is_within(spec->limit_n, 0.0, 655.34) || !is_within(spec->amplitude_n, 0.0, spec->limit_n)) {
        return STEPPED_SINE_BAD_AMPLITUDE;
    }
    const double times_s[] = {spec->ramp_s, spec->dwell_s, spec->settle_s, spec->window_s};
    for (size_t i = 0; i < sizeof times_s / sizeof times_s[0]; i++) {
        if (!is_within(times_s[i], 0.0, 3600.0)) {
            return STEPPED_SINE_BAD_TIME;
        }
    }
    return 2.0 * spec->ramp_s <= length_s ? STEPPED_SINE_PLAYABLE : STEPPED_SINE_BAD_TIME;
}

void open_loop_init(open_loop *controller, const stepped_sine_spec *spec)
{
    *controller = (open_loop){.spec = *spec};
    for (size_t i = 0; i < spec->points; i++) {
        const double hz = spec->frequencies_hz[i];
        controller->starts_s[i + 1] = controller->starts_s[i] + round_up(spec->dwell_s * hz) / hz;
    }
}

/* Raised cosine at both ends: (1 - cos(pi t/r))/2. */
static double envelope(const open_loop *controller, double t_s)
{
    const double left_s = controller->starts_s[controller->spec.points] - t_s;
    const double to_end_s = t_s < left_s ? t_s : left_s;
    if (to_end_s >= controller->spec.ramp_s) {
        return 1.0;
    }
    return 0.5 * (1.0 - cosine_of_cycles(0.5 * (to_end_s / controller->spec.ramp_s)));
}

resonarm_answer open_loop_answer(void *context, const resonarm_sample *sample)
{
    const open_loop *controller = context;
    const stepped_sine_spec *spec = &controller->spec;
    const double t_s = (double)sample->sample / spec->rate_hz;
    if ((double)sample->sample >= round_up(controller->starts_s[spec->points] * spec->rate_hz)) {
        return (resonarm_answer){.action = RESONARM_FINISH};
    }
    size_t step = 0;
    while (step + 1 < spec->points && controller->starts_s[step + 1] <= t_s) {
        step++;
    }
    const double cycles = spec->frequencies_hz[step] * (t_s - controller->starts_s[step]);
    const double shape = envelope(controller, t_s) * sine_of_cycles(cycles);
    return (resonarm_answer){.action = RESONARM_HOLD_FORCE, .force_x_n = spec->amplitude_n * shape};
}
