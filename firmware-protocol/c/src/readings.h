/** @file readings.h
 * @brief Converts a sample of the FD profile to the messages of the classic profile. */
#ifndef RESONARM_READINGS_H
#define RESONARM_READINGS_H

#include "resonarm_exciter.h"

/** The sample of this index, not yet counted. */
resonarm_sample resonarm_readings_sample(const resonarm_readings *readings, uint16_t index);

#endif
