/** @file encode.h
 * @brief A message's content and its frame, made separately: a waiting message has no counter yet. */
#ifndef RESONARM_ENCODE_H
#define RESONARM_ENCODE_H

#include "resonarm.h"

/** Writes the content of a message into RESONARM_FRAME_BYTES zero bytes. */
resonarm_encoding resonarm_encode_content(resonarm_profile profile, const resonarm_message *message, uint8_t *content);

/** The frame of a content that is sendable, with the next counter of its kind. */
void resonarm_encode_frame(
    const resonarm_transmitter *transmitter, resonarm_kind kind, const uint8_t *content, resonarm_frame *frame);

#endif
