/** @file e2e.h
 * @brief AUTOSAR E2E protection (section 2). Profile 11, variant 11A, of classical frames: CRC in byte 0, counter in
 * the low nibble of byte 1. Profile 5 of CAN FD frames: CRC in the bytes 0 and 1, counter in byte 2. */
#ifndef RESONARM_E2E_H
#define RESONARM_E2E_H

#include "resonarm.h"

/** The largest counter of Profile 11; the next is 0. */
#define E2E_P11_COUNTER_MAX 14u
/** The largest counter of Profile 5; the next is 0. */
#define E2E_P5_COUNTER_MAX 255u
/** Bytes in a frame under Profile 11. */
#define E2E_P11_BYTES 8u

/** The CRC of a frame of eight bytes, without its byte 0, under a data id. */
uint8_t resonarm_e2e_p11_crc(uint16_t data_id, const uint8_t *data);

/** The CRC of a frame of `length` bytes, 2 or more, without its bytes 0 and 1, under a data id. */
uint16_t resonarm_e2e_p5_crc(uint16_t data_id, const uint8_t *data, size_t length);

/** The counter after this one. */
uint8_t resonarm_e2e_counter_after(uint8_t counter, uint8_t counter_max);

/** Checks a counter: accepted, with the number of frames lost before it, or the verdict that rejects it. */
resonarm_verdict resonarm_e2e_supervise(
    resonarm_supervision *supervision, uint8_t counter, uint8_t counter_max, uint8_t *lost);

#endif
