/** @file loop.h
 * @brief Runs a node on a port until its work has ended and it has left the bus. */
#ifndef LOOP_H
#define LOOP_H

#include "resonarm_exciter.h"

/** How the loop ended. */
typedef enum {
    LOOP_ENDED,    /**< The node's report says how. */
    LOOP_NO_PLANT, /**< No plant was armed in time. */
    LOOP_NO_BUS    /**< The bus has failed. */
} loop_end;

/** Runs a node that was made and not started; a plant has to be armed within `patience_ns`. */
loop_end loop_run(resonarm_exciter *exciter, uint64_t patience_ns);

#endif
