#include "link.h"

#include "encode.h"
#include "listening.h"
#include "outbox.h"

/*
 * Two look periods before it is due, so that a node that acts only at its ticks keeps the period (section 6); at most
 * half a period.
 */
static uint64_t early_ns(const resonarm_link_ *link, uint64_t period_ns)
{
    const uint64_t look_ns = link->timing.look_period_ns;
    return look_ns > period_ns / 4 ? period_ns / 2 : period_ns - 2 * look_ns;
}

static void send_heartbeat(resonarm_link_ *link, uint64_t now_ns)
{
    resonarm_message message = {.kind = RESONARM_EXCITER_HEARTBEAT};
    message.content.state = link->state;
    link->heartbeat_at_ns = resonarm_saturating_sum(now_ns, early_ns(link, RESONARM_HEARTBEAT_PERIOD_NS));
    (void)resonarm_link_send(link, &message);
}

void resonarm_link_init(resonarm_link_ *link, const resonarm_exciter_config *config)
{
    *link = (resonarm_link_){.timing = config->timing, .state = RESONARM_BOOT_UP};
    link->listening.look_period_ns = config->timing.look_period_ns;
    link->hello = resonarm_own_hello(config->network.profile, config->rate_hz);
    link->capabilities = config->capabilities;
    if (link->capabilities.samples_per_frame < 1 || link->capabilities.samples_per_frame > 2) {
        /* As of a partner that says nothing of it. */
        link->capabilities.samples_per_frame = 1;
    }
    resonarm_transmitter_init(&link->transmitter, config->network);
    resonarm_receiver_init(&link->receiver, config->network);
}

void resonarm_link_start(resonarm_link_ *link, uint64_t now_ns)
{
    link->listening.looked_at_ns = now_ns;
    send_heartbeat(link, now_ns);
    resonarm_link_transition(link, now_ns, RESONARM_EVENT_STARTED);
    resonarm_link_send_hello(link, now_ns);
}

void resonarm_link_transition(resonarm_link_ *link, uint64_t now_ns, resonarm_event event)
{
    const resonarm_state from = link->state;
    link->state = resonarm_next_state(from, event);
    if (link->state == from) {
        return;
    }
    if (from == RESONARM_OPERATIONAL) {
        resonarm_outbox_clear_command(&link->outbox);
    }
    send_heartbeat(link, now_ns);
}

bool resonarm_link_accept(resonarm_link_ *link, uint64_t now_ns, const resonarm_frame *frame, resonarm_message *message)
{
    resonarm_listening_look(&link->listening, now_ns);
    const resonarm_receipt receipt = resonarm_accept(&link->receiver, frame, message);
    if (receipt.verdict == RESONARM_IGNORED) {
        return false;
    }
    if (receipt.verdict != RESONARM_ACCEPTED) {
        /* Remote frames and the requests of an operator's station do not show another sender. */
        const bool is_own =
            resonarm_sender(receipt.kind) == RESONARM_EXCITER && receipt.kind != RESONARM_OPERATOR_COMMAND;
        const bool is_question = receipt.verdict == RESONARM_BAD_FORMAT && frame->format == RESONARM_FRAME_REMOTE;
        link->refused_frames++;
        link->other_sender_frames += is_own && !is_question ? 1 : 0;
        return false;
    }
    if (resonarm_sender(receipt.kind) != RESONARM_PLANT) {
        /* An operator's station may send requests in this node's place. */
        if (receipt.kind != RESONARM_OPERATOR_COMMAND) {
            link->second_sender = resonarm_identifier(link->receiver.network, receipt.kind);
        }
        return false;
    }
    link->partner_heard_ns = link->listening.listened_ns;
    return true;
}

#ifndef RESONARM_CLASSIC_ONLY
/* Not so for a number that is none. */
static bool is_within(double limit, double value)
{
    return value >= -limit && value <= limit;
}
#endif

bool resonarm_link_is_stated(const resonarm_link_ *link, const resonarm_message *command)
{
#ifndef RESONARM_CLASSIC_ONLY
    const resonarm_capabilities *stated = &link->capabilities;
    if (link->hello.profile == RESONARM_PROFILE_FD && command->kind == RESONARM_FORCE_COMMAND) {
        const resonarm_force_command *force = &command->content.force;
        return is_within(stated->force_limit_n, force->force_x_n) && is_within(stated->force_limit_n, force->force_y_n);
    }
    if (link->hello.profile == RESONARM_PROFILE_FD && command->kind == RESONARM_TORQUE_COMMAND) {
        const resonarm_torque_command *torque = &command->content.torque;
        return is_within(stated->torque_limit_nm, torque->torque1_nm) &&
               is_within(stated->torque_limit_nm, torque->torque2_nm);
    }
#else
    (void)link;
    (void)command;
#endif
    return true;
}

bool resonarm_link_send(resonarm_link_ *link, const resonarm_message *message)
{
    uint8_t content[RESONARM_FRAME_BYTES] = {0};
    resonarm_waiting_ waiting = {.kind = message->kind};
    const resonarm_profile profile = link->transmitter.network.profile;
    if (resonarm_encode_content(profile, message, content).reason != RESONARM_SENDABLE) {
        return false;
    }
    for (size_t i = 0; i < RESONARM_EXCITER_BYTES_; i++) {
        waiting.content[i] = content[i];
    }
    resonarm_outbox_push(&link->outbox, &waiting);
    if (!link->is_waiting) {
        link->is_waiting = true;
        link->waiting_since_ns = link->listening.listened_ns;
    }
    return true;
}

void resonarm_link_send_hello(resonarm_link_ *link, uint64_t now_ns)
{
    resonarm_message message = {.kind = RESONARM_EXCITER_HELLO};
    message.content.hello = link->hello;
    link->hello_at_ns = resonarm_saturating_sum(now_ns, early_ns(link, RESONARM_HELLO_PERIOD_NS));
    (void)resonarm_link_send(link, &message);
#ifndef RESONARM_CLASSIC_ONLY
    if (link->hello.profile == RESONARM_PROFILE_FD) {
        message = (resonarm_message){.kind = RESONARM_EXCITER_CAPABILITIES};
        message.content.capabilities = link->capabilities;
        (void)resonarm_link_send(link, &message);
    }
#endif
}

void resonarm_link_handle_deadline(resonarm_link_ *link, uint64_t now_ns)
{
    resonarm_listening_look(&link->listening, now_ns);
    if (now_ns >= link->heartbeat_at_ns) {
        send_heartbeat(link, now_ns);
    }
    if (now_ns >= link->hello_at_ns) {
        resonarm_link_send_hello(link, now_ns);
    }
}

bool resonarm_link_is_partner_lost(const resonarm_link_ *link)
{
    return resonarm_listening_has_passed(&link->listening, link->partner_heard_ns, link->timing.partner_timeout_ns);
}

bool resonarm_link_is_jammed(const resonarm_link_ *link)
{
    return link->is_waiting &&
           resonarm_listening_has_passed(&link->listening, link->waiting_since_ns, link->timing.command_timeout_ns);
}

uint16_t resonarm_link_not_sent(const resonarm_link_ *link)
{
    const uint64_t frames = (uint64_t)link->outbox.unsent + resonarm_outbox_waiting(&link->outbox);
    return frames > UINT16_MAX ? UINT16_MAX : (uint16_t)frames;
}

bool resonarm_link_next_frame(const resonarm_link_ *link, resonarm_frame *frame)
{
    const resonarm_waiting_ *message = resonarm_outbox_front(&link->outbox);
    if (message == NULL) {
        return false;
    }
    resonarm_encode_frame(&link->transmitter, message->kind, message->content, frame);
    return true;
}

void resonarm_link_frame_sent(resonarm_link_ *link)
{
    const resonarm_waiting_ *message = resonarm_outbox_front(&link->outbox);
    if (message == NULL) {
        return;
    }
    resonarm_frame_taken(&link->transmitter, message->kind);
    resonarm_outbox_pop(&link->outbox);
    link->is_waiting = resonarm_outbox_front(&link->outbox) != NULL;
    link->waiting_since_ns = link->listening.listened_ns;
}
