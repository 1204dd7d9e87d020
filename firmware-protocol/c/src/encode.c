#include "encode.h"

#include "axes.h"
#include "bytes.h"
#include "e2e.h"
#include "fd.h"
#include "scaling.h"

static const resonarm_encoding sendable = {RESONARM_SENDABLE, NULL, 0.0, 0.0, 0.0};

static resonarm_encoding encode_axes(const resonarm_message *message, uint8_t *data)
{
    static const uint8_t flags[2] = {FLAG_X_SATURATED, FLAG_Y_SATURATED};
    const axes_coding *coding = resonarm_axes_coding_of(message->kind);
    const bool is_measured = resonarm_axes_are_measured(message->kind);
    const axes values = resonarm_axes_of(message);
    const double limit = resonarm_value_of(RESONARM_COUNT_MAX, coding->counts_per_unit);
    for (size_t axis = 0; axis < 2; axis++) {
        int16_t count;
        const double got = values.values[axis];
        const count_range range = resonarm_count_of(got, coding->counts_per_unit, &count);
        if (range == COUNT_NOT_FINITE) {
            return (resonarm_encoding){RESONARM_NOT_FINITE, coding->signals[axis], got, -limit, limit};
        }
        if (range == COUNT_BEYOND && !is_measured) {
            return (resonarm_encoding){RESONARM_OUT_OF_RANGE, coding->signals[axis], got, -limit, limit};
        }
        if (range == COUNT_BEYOND || values.saturated[axis]) {
            data[1] |= flags[axis];
        }
        put_u16(data + 2 + 2 * axis, (uint16_t)count);
    }
    put_u16(data + 6, values.sample);
    return sendable;
}

static resonarm_encoding check(const char *signal, uint32_t got, uint32_t min, uint32_t max)
{
    if (got >= min && got <= max) {
        return sendable;
    }
    return (resonarm_encoding){RESONARM_INVALID, signal, got, min, max};
}

static resonarm_encoding encode_operator(const resonarm_operator_command *command, uint8_t *data)
{
    resonarm_encoding encoding = check("request", (uint32_t)command->request, RESONARM_ARM, RESONARM_RESET);
    if (encoding.reason == RESONARM_SENDABLE) {
        encoding = check("target", (uint32_t)command->target, RESONARM_PLANT, RESONARM_EXCITER);
    }
    data[2] = (uint8_t)command->request;
    data[3] = (uint8_t)command->target;
    return encoding;
}

static resonarm_encoding encode_hello(const resonarm_hello *hello, uint8_t *data)
{
    const resonarm_encoding checks[] = {
        check("version_major", hello->version_major, 0, 15),
        check("version_minor", hello->version_minor, 0, 15),
        check("dbc_hash", hello->dbc_hash, 0, 0xFFFFFFu),
        check("rate_hz", hello->rate_hz, 1, 0xFFFFu),
        check("profile", (uint32_t)hello->profile, RESONARM_PROFILE_CLASSIC, RESONARM_PROFILE_FD),
    };
    for (size_t i = 0; i < sizeof checks / sizeof checks[0]; i++) {
        if (checks[i].reason != RESONARM_SENDABLE) {
            return checks[i];
        }
    }
    data[1] |= (uint8_t)((unsigned)hello->profile << 4);
    data[2] = (uint8_t)((unsigned)hello->version_major << 4 | hello->version_minor);
    put_u16(data + 3, (uint16_t)(hello->dbc_hash & 0xFFFFu));
    data[5] = (uint8_t)(hello->dbc_hash >> 16);
    put_u16(data + 6, hello->rate_hz);
    return sendable;
}

static resonarm_encoding encode_heartbeat(resonarm_state state, uint8_t *data)
{
    switch (state) {
    case RESONARM_BOOT_UP:
    case RESONARM_FAULT:
    case RESONARM_OPERATIONAL:
    case RESONARM_PRE_OPERATIONAL:
        data[0] = (uint8_t)state;
        return sendable;
    }
    return (resonarm_encoding){RESONARM_INVALID, "state", state, RESONARM_BOOT_UP, RESONARM_PRE_OPERATIONAL};
}

static resonarm_encoding encode_emergency(const resonarm_emergency *emergency, uint8_t *data)
{
    put_u16(data + 2, (uint16_t)emergency->code);
    put_u16(data + 4, emergency->detail);
    put_u16(data + 6, emergency->sample);
    return check("code", (uint32_t)emergency->code, RESONARM_COMMAND_TIMEOUT, RESONARM_EXCITER_TRIPPED);
}

/* The content of a classical frame. */
static resonarm_encoding encode_classic(const resonarm_message *message, uint8_t *content)
{
    switch (message->kind) {
    case RESONARM_OPERATOR_COMMAND:
        return encode_operator(&message->content.operator_command, content);
    case RESONARM_PLANT_HELLO:
    case RESONARM_EXCITER_HELLO:
        return encode_hello(&message->content.hello, content);
    case RESONARM_PLANT_HEARTBEAT:
    case RESONARM_EXCITER_HEARTBEAT:
        return encode_heartbeat(message->content.state, content);
    case RESONARM_PLANT_EMERGENCY:
    case RESONARM_EXCITER_EMERGENCY:
        return encode_emergency(&message->content.emergency, content);
    default:
        return encode_axes(message, content);
    }
}

resonarm_encoding resonarm_encode_content(resonarm_profile profile, const resonarm_message *message, uint8_t *content)
{
    const resonarm_kind kind = message->kind;
    if ((unsigned)kind >= RESONARM_KINDS) {
        return (resonarm_encoding){RESONARM_INVALID, "kind", kind, 0, RESONARM_KINDS - 1};
    }
    if (resonarm_length(profile, kind) == 0) {
        return (resonarm_encoding){RESONARM_NOT_SENT, NULL, 0.0, 0.0, 0.0};
    }
#ifndef RESONARM_CLASSIC_ONLY
    if (resonarm_format(profile, kind) == RESONARM_FRAME_FD) {
        return resonarm_fd_encode(message, content);
    }
#endif
    return encode_classic(message, content);
}

void resonarm_encode_frame(
    const resonarm_transmitter *transmitter, resonarm_kind kind, const uint8_t *content, resonarm_frame *frame)
{
    const resonarm_network network = transmitter->network;
    const uint16_t data_id = resonarm_data_id(network, kind);
    const uint8_t counter = transmitter->counters[kind];
    *frame = (resonarm_frame){
        .id = resonarm_identifier(network, kind),
        .id_format = RESONARM_ID_STANDARD,
        .format = resonarm_format(network.profile, kind),
        .length = resonarm_length(network.profile, kind),
    };
    for (size_t i = 0; i < frame->length; i++) {
        frame->data[i] = content[i];
    }
#ifndef RESONARM_CLASSIC_ONLY
    if (frame->format == RESONARM_FRAME_FD) {
        frame->data[2] = counter;
        put_u16(frame->data, resonarm_e2e_p5_crc(data_id, frame->data, frame->length));
        return;
    }
#endif
    if (data_id != 0) {
        frame->data[1] |= counter;
        frame->data[0] = resonarm_e2e_p11_crc(data_id, frame->data);
    }
}

void resonarm_transmitter_init(resonarm_transmitter *transmitter, resonarm_network network)
{
    *transmitter = (resonarm_transmitter){.network = network};
}

resonarm_encoding resonarm_encode(
    const resonarm_transmitter *transmitter, const resonarm_message *message, resonarm_frame *frame)
{
    uint8_t content[RESONARM_FRAME_BYTES] = {0};
    const resonarm_encoding encoding = resonarm_encode_content(transmitter->network.profile, message, content);
    if (encoding.reason == RESONARM_SENDABLE) {
        resonarm_encode_frame(transmitter, message->kind, content, frame);
    }
    return encoding;
}

void resonarm_frame_taken(resonarm_transmitter *transmitter, resonarm_kind kind)
{
    const bool is_fd = resonarm_format(transmitter->network.profile, kind) == RESONARM_FRAME_FD;
    const uint8_t counter_max = is_fd ? E2E_P5_COUNTER_MAX : E2E_P11_COUNTER_MAX;
    transmitter->counters[kind] = resonarm_e2e_counter_after(transmitter->counters[kind], counter_max);
}
