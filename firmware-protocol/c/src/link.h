/** @file link.h
 * @brief A node's connection to the bus: state, heartbeats, hellos, and the time listened (sections 5 to 8). */
#ifndef RESONARM_LINK_H
#define RESONARM_LINK_H

#include "resonarm_exciter.h"

/** A link in the state boot-up. */
void resonarm_link_init(resonarm_link_ *link, const resonarm_exciter_config *config);

/** Boot-up heartbeat, then pre-operational, then hello. */
void resonarm_link_start(resonarm_link_ *link, uint64_t now_ns);

/** Follows the table of states; sends a heartbeat at a change. */
void resonarm_link_transition(resonarm_link_ *link, uint64_t now_ns, resonarm_event event);

/** The plant's message in a frame; false if there is none. */
bool resonarm_link_accept(
    resonarm_link_ *link, uint64_t now_ns, const resonarm_frame *frame, resonarm_message *message);

/** Queues a message; false if it can't be sent. */
bool resonarm_link_send(resonarm_link_ *link, const resonarm_message *message);

/** Whether a command is within what the node has stated: the limits of its capabilities, sent in the FD profile. */
bool resonarm_link_is_stated(const resonarm_link_ *link, const resonarm_message *command);
/** Queues the hello, in the FD profile followed by the capabilities. */
void resonarm_link_send_hello(resonarm_link_ *link, uint64_t now_ns);

/** Checks the clock, and queues the heartbeat and the hello that are due. */
void resonarm_link_handle_deadline(resonarm_link_ *link, uint64_t now_ns);

/** Whether the plant's heartbeat has timed out. */
bool resonarm_link_is_partner_lost(const resonarm_link_ *link);

/** Whether frames wait and none could be sent in time. */
bool resonarm_link_is_jammed(const resonarm_link_ *link);

/** Frames that wait or were replaced by newer ones, at most 65535. */
uint16_t resonarm_link_not_sent(const resonarm_link_ *link);

/** The frame to send next; false if none waits. */
bool resonarm_link_next_frame(const resonarm_link_ *link, resonarm_frame *frame);

/** The bus has taken it. */
void resonarm_link_frame_sent(resonarm_link_ *link);

#endif
