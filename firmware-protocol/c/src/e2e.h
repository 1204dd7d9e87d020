/** @file e2e.h
 * @brief AUTOSAR E2E Profile 11, variant 11A: CRC in byte 0, counter in the low nibble of byte 1 (section 2). */
#ifndef RESONARM_E2E_H
#define RESONARM_E2E_H

#include "resonarm.h"

/** The largest counter; the next is 0. */
#define E2E_COUNTER_MAX 14u
/** The largest step of the counter that is accepted. */
#define E2E_MAX_DELTA_COUNTER 4u
/** Bytes in a protected frame. */
#define E2E_P11_BYTES 8u

/** The CRC of a frame of eight bytes, without its byte 0, under a data id. */
uint8_t e2e_p11_crc(uint16_t data_id, const uint8_t *data);

/** The counter after this one. */
uint8_t e2e_p11_counter_after(uint8_t counter);

/** Judges a counter: accepted with the number of frames lost before it, or the verdict that refuses it. */
resonarm_verdict e2e_p11_supervise(resonarm_supervision *supervision, uint8_t counter, uint8_t *lost);

#endif
