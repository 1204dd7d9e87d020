#include "outbox.h"

/* Whether two messages of one kind have the same bytes. */
static bool are_equal(const resonarm_message *one, const resonarm_message *other)
{
    const resonarm_transmitter transmitter = {.network = {RESONARM_BASE_DEFAULT, 1, 2}};
    resonarm_frame of_one, of_other;
    if (resonarm_encode(&transmitter, one, &of_one).reason != RESONARM_SENDABLE ||
        resonarm_encode(&transmitter, other, &of_other).reason != RESONARM_SENDABLE) {
        return false;
    }
    for (size_t i = 0; i < of_one.length; i++) {
        if (of_one.data[i] != of_other.data[i]) {
            return false;
        }
    }
    return true;
}

static resonarm_message *place(resonarm_outbox_ *outbox, size_t at)
{
    return &outbox->control[(outbox->first + at) % RESONARM_OUTBOX_MESSAGES];
}

/* Whether the latest message of this kind that waits says the same. */
static bool is_said(resonarm_outbox_ *outbox, const resonarm_message *message)
{
    for (size_t at = outbox->count; at > 0; at--) {
        const resonarm_message *waiting = place(outbox, at - 1);
        if (waiting->kind == message->kind) {
            return are_equal(waiting, message);
        }
    }
    return false;
}

void outbox_push(resonarm_outbox_ *outbox, const resonarm_message *message)
{
    if (message->kind == RESONARM_FORCE_COMMAND || message->kind == RESONARM_TORQUE_COMMAND) {
        outbox->unsent += outbox->has_command ? 1 : 0;
        outbox->command = *message;
        outbox->has_command = true;
    } else if (!is_said(outbox, message)) {
        if (outbox->count == RESONARM_OUTBOX_MESSAGES) {
            outbox->unsent++;
        } else {
            *place(outbox, outbox->count) = *message;
            outbox->count++;
        }
    }
}

const resonarm_message *outbox_front(const resonarm_outbox_ *outbox)
{
    if (outbox->count > 0) {
        return &outbox->control[outbox->first];
    }
    return outbox->has_command ? &outbox->command : NULL;
}

void outbox_pop(resonarm_outbox_ *outbox)
{
    if (outbox->count > 0) {
        outbox->first = (outbox->first + 1) % RESONARM_OUTBOX_MESSAGES;
        outbox->count--;
    } else {
        outbox->has_command = false;
    }
}

void outbox_clear_command(resonarm_outbox_ *outbox)
{
    outbox->has_command = false;
}

uint32_t outbox_waiting(const resonarm_outbox_ *outbox)
{
    return (uint32_t)outbox->count + (outbox->has_command ? 1 : 0);
}
