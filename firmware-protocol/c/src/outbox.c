#include "outbox.h"

/* Whether two messages of one kind have the same content. */
static bool are_equal(const resonarm_waiting_ *one, const resonarm_waiting_ *other)
{
    for (size_t i = 0; i < RESONARM_EXCITER_BYTES_; i++) {
        if (one->content[i] != other->content[i]) {
            return false;
        }
    }
    return true;
}

static resonarm_waiting_ *place(resonarm_outbox_ *outbox, size_t at)
{
    return &outbox->control[(outbox->first + at) % RESONARM_OUTBOX_MESSAGES];
}

/* Whether the latest waiting message of this kind has the same content. */
static bool is_said(resonarm_outbox_ *outbox, const resonarm_waiting_ *message)
{
    for (size_t at = outbox->count; at > 0; at--) {
        const resonarm_waiting_ *waiting = place(outbox, at - 1);
        if (waiting->kind == message->kind) {
            return are_equal(waiting, message);
        }
    }
    return false;
}

void resonarm_outbox_push(resonarm_outbox_ *outbox, const resonarm_waiting_ *message)
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

const resonarm_waiting_ *resonarm_outbox_front(const resonarm_outbox_ *outbox)
{
    if (outbox->count > 0) {
        return &outbox->control[outbox->first];
    }
    return outbox->has_command ? &outbox->command : NULL;
}

void resonarm_outbox_pop(resonarm_outbox_ *outbox)
{
    if (outbox->count > 0) {
        outbox->first = (outbox->first + 1) % RESONARM_OUTBOX_MESSAGES;
        outbox->count--;
    } else {
        outbox->has_command = false;
    }
}

void resonarm_outbox_clear_command(resonarm_outbox_ *outbox)
{
    outbox->has_command = false;
}

uint32_t resonarm_outbox_waiting(const resonarm_outbox_ *outbox)
{
    return (uint32_t)outbox->count + (outbox->has_command ? 1 : 0);
}
