/** @file fd.h
 * @brief The contents of CAN FD frames (section 4): singles after eight bytes of header. */
#ifndef RESONARM_FD_H
#define RESONARM_FD_H

#include "resonarm.h"

/** Writes the content of a message that is a CAN FD frame into RESONARM_FRAME_BYTES zero bytes. */
resonarm_encoding resonarm_fd_encode(const resonarm_message *message, uint8_t *content);

/** The message of this kind in a CAN FD frame whose length and protection are right. */
resonarm_receipt resonarm_fd_decode(resonarm_kind kind, const uint8_t *data, resonarm_message *message);

#endif
