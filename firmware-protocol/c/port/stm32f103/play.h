/** @file play.h
 * @brief The exciter's node on an STM32F103, in lockstep with a plant of 1000 Hz. */
#ifndef PLAY_H
#define PLAY_H

#include "resonarm_exciter.h"

/** Lets the function answer samples until the node has left the bus; 0 if its work ended. */
int play(resonarm_answer_function answer, void *context);

#endif
