#include "options.h"

#include <stdlib.h>
#include <string.h>

const char options_usage[] =
    "controller INTERFACE --frequencies-hz F,F,... --amplitude-n N [OPTION...]\n"
    "  A stepped sine along x whose amplitude in the impedance head is held, on a CAN interface.\n"
    "  --rate-hz N             sample rate of the plant (1000)\n"
    "  --lockstep              the plant waits for the answer to each sample\n"
    "  --open-loop             play the stepped sine without control; the amplitude is that of the command\n"
    "  --limit-n N             largest amplitude of the command (655.34)\n"
    "  --ramp-s, --settle-s, --window-s, --dwell-s N\n"
    "                          ramps (0.5), settling before a reading (1), reading (2), step in open loop (4)\n"
    "  --base ID, --plant-id N, --exciter-id N, --profile classic|fd\n"
    "                          the network (that of resonarm_config.h)\n"
    "  --patience-s N          how long to wait until a plant is armed (60)\n"
    "  --command-timeout-s, --partner-timeout-s N\n"
    "                          instead of the times of the specification\n"
    "exit status: 0 finished, 2 usage, 3 no bus or no plant, 4 fault of the plant, 5 fault of the controller,\n"
    "             6 gave up, 7 stopped, 8 the plant left\n";

/* Reads a number that ends the text or is followed by `end`. */
static bool read_number(const char *text, char end, double *number, const char **rest)
{
    char *after;
    *number = strtod(text, &after);
    *rest = after;
    return after != text && (*after == 0 || *after == end) && *number - *number >= 0.0;
}

static bool read_frequencies(stepped_sine_spec *spec, const char *text)
{
    for (spec->points = 0; spec->points < STEPPED_SINE_POINTS; spec->points++) {
        const char *rest;
        if (!read_number(text, ',', &spec->frequencies_hz[spec->points], &rest)) {
            return false;
        }
        if (*rest == 0) {
            spec->points++;
            return true;
        }
        text = rest + 1;
    }
    return false;
}

/* Reads a whole number, decimal or hexadecimal. */
static bool read_whole(const char *text, unsigned long max, unsigned long *number)
{
    char *after;
    *number = strtoul(text, &after, 0);
    return after != text && *after == 0 && *number <= max;
}

/* Reads an option of the network; returns NULL, or an error, also if it is none of them. */
static const char *read_network(resonarm_network *network, const char *name, const char *value)
{
    unsigned long number;
    if (strcmp(name, "--profile") == 0) {
        network->profile = strcmp(value, "fd") == 0 ? RESONARM_PROFILE_FD : RESONARM_PROFILE_CLASSIC;
        const bool is_known = network->profile == RESONARM_PROFILE_FD || strcmp(value, "classic") == 0;
        return is_known ? NULL : "--profile: classic or fd";
    }
    if (strcmp(name, "--base") == 0 && read_whole(value, UINT16_MAX, &number)) {
        network->base = (uint16_t)number;
    } else if (strcmp(name, "--plant-id") == 0 && read_whole(value, UINT8_MAX, &number)) {
        network->plant_id = (uint8_t)number;
    } else if (strcmp(name, "--exciter-id") == 0 && read_whole(value, UINT8_MAX, &number)) {
        network->exciter_id = (uint8_t)number;
    } else {
        return "no such option, or not a whole number";
    }
    return NULL;
}

static const char *check_network(resonarm_network *network)
{
    const resonarm_network asked = *network;
    switch (resonarm_network_init(network, asked.base, asked.plant_id, asked.exciter_id, asked.profile)) {
    case RESONARM_NETWORK_VALID:
        return NULL;
    case RESONARM_NODE_ID_OUT_OF_RANGE:
    case RESONARM_SAME_NODE_ID:
        return "--plant-id, --exciter-id: two numbers from 1 to 127";
    default:
        return "--base: a multiple of 0x10 from 0x180 to 0x570";
    }
}

/* An option with a number. */
typedef struct {
    const char *name;
    double *number;
} numeric;

static const char *read_value(options *read, const numeric *numbers, size_t count, const char *name, const char *value)
{
    const char *rest;
    if (strcmp(name, "--frequencies-hz") == 0) {
        const bool is_list = read_frequencies(&read->spec, value);
        return is_list ? NULL : "--frequencies-hz: 1 to 16 numbers separated by commas";
    }
    for (size_t i = 0; i < count; i++) {
        if (strcmp(name, numbers[i].name) == 0) {
            return read_number(value, 0, numbers[i].number, &rest) ? NULL : "a number is expected";
        }
    }
    return read_network(&read->network, name, value);
}

static const char *message_of(stepped_sine_check check)
{
    switch (check) {
    case STEPPED_SINE_PLAYABLE:
        return NULL;
    case STEPPED_SINE_BAD_RATE:
        return "--rate-hz: 1 to 65535";
    case STEPPED_SINE_BAD_POINTS:
        return "--frequencies-hz: 1 to 16 of them";
    case STEPPED_SINE_BAD_FREQUENCY:
        return "--frequencies-hz: above 0.001 Hz and at most a twelfth of the rate";
    case STEPPED_SINE_BAD_AMPLITUDE:
        return "--amplitude-n: up to --limit-n, which is up to 655.34";
    case STEPPED_SINE_BAD_TIME:
        break;
    }
    return "times: 0 to 3600 s, two ramps no longer than all steps of --dwell-s";
}

static uint64_t nanoseconds(double seconds, uint64_t otherwise_ns)
{
    return seconds > 0.0 && seconds < 1e9 ? (uint64_t)(seconds * 1e9) : otherwise_ns;
}

const char *options_read(options *read, int count, char **arguments)
{
    double command_timeout_s = 0.0, partner_timeout_s = 0.0;
    *read = (options){.network = resonarm_own_network(), .patience_s = 60.0};
    read->spec = (stepped_sine_spec){
        .rate_hz = 1000.0, .limit_n = 655.34, .ramp_s = 0.5, .settle_s = 1.0, .window_s = 2.0, .dwell_s = 4.0};
    const numeric numbers[] = {
        {"--rate-hz", &read->spec.rate_hz},           {"--amplitude-n", &read->spec.amplitude_n},
        {"--limit-n", &read->spec.limit_n},           {"--ramp-s", &read->spec.ramp_s},
        {"--settle-s", &read->spec.settle_s},         {"--window-s", &read->spec.window_s},
        {"--dwell-s", &read->spec.dwell_s},           {"--patience-s", &read->patience_s},
        {"--command-timeout-s", &command_timeout_s},  {"--partner-timeout-s", &partner_timeout_s},
    };
    for (int at = 1; at < count; at++) {
        const char *word = arguments[at];
        const char *wrong = NULL;
        if (strcmp(word, "--lockstep") == 0) {
            read->is_lockstep = true;
        } else if (strcmp(word, "--open-loop") == 0) {
            read->is_open_loop = true;
        } else if (word[0] != '-' && read->interface == NULL) {
            read->interface = word;
        } else if (at + 1 == count) {
            return "the last option has no value";
        } else {
            wrong = read_value(read, numbers, sizeof numbers / sizeof numbers[0], word, arguments[++at]);
        }
        if (wrong != NULL) {
            return wrong;
        }
    }
    const char *wrong = message_of(stepped_sine_check_spec(&read->spec));
    wrong = wrong == NULL ? check_network(&read->network) : wrong;
    if (wrong != NULL || read->interface == NULL) {
        return wrong != NULL ? wrong : "no interface";
    }
    read->timing = read->is_lockstep ? resonarm_lockstep() : resonarm_real_time((uint16_t)read->spec.rate_hz);
    read->timing.command_timeout_ns = nanoseconds(command_timeout_s, read->timing.command_timeout_ns);
    read->timing.partner_timeout_ns = nanoseconds(partner_timeout_s, read->timing.partner_timeout_ns);
    return NULL;
}
