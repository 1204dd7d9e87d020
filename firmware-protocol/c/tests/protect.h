/** @file protect.h
 * @brief Corrects the CRC of a frame, so that a test gets past the CRC check. */
#ifndef PROTECT_H
#define PROTECT_H

#include "bytes.h"
#include "e2e.h"

/** For a frame with the identifier of this kind, of any length. */
static inline void protect(resonarm_network network, resonarm_kind kind, resonarm_frame *frame)
{
    const uint16_t data_id = resonarm_data_id(network, kind);
    if (resonarm_format(network.profile, kind) == RESONARM_FRAME_FD) {
        put_u16(frame->data, resonarm_e2e_p5_crc(data_id, frame->data, resonarm_length(network.profile, kind)));
    } else if (data_id != 0) {
        frame->data[0] = resonarm_e2e_p11_crc(data_id, frame->data);
    }
}

#endif
