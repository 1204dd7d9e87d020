/** @file options.h
 * @brief The controller's command line. */
#ifndef OPTIONS_H
#define OPTIONS_H

#include "stepped_sine.h"

/** The settings on the command line. */
typedef struct {
    const char *interface;
    resonarm_network network;
    resonarm_timing timing;
    stepped_sine_spec spec;
    bool is_lockstep;
    bool is_open_loop;
    double patience_s;
} options;

/** The usage, for standard error. */
extern const char options_usage[];

/** Reads the command line; returns NULL, or an error. */
const char *options_read(options *read, int count, char **arguments);

#endif
