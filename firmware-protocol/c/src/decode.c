#include "axes.h"
#include "bytes.h"
#include "e2e.h"
#include "fd.h"
#include "resonarm.h"
#include "scaling.h"

static resonarm_receipt accepted(resonarm_kind kind)
{
    return (resonarm_receipt){RESONARM_ACCEPTED, kind, NULL, 0, 0};
}

static resonarm_receipt unknown(resonarm_kind kind, const char *signal, uint16_t got)
{
    return (resonarm_receipt){RESONARM_UNKNOWN_VALUE, kind, signal, got, 0};
}

/* Rejects flags, in the high nibble of byte 1, other than those in `used`. */
static resonarm_receipt check_flags(resonarm_kind kind, const uint8_t *data, unsigned used)
{
    const uint16_t reserved = (uint16_t)(data[1] & 0xF0u & ~used);
    if (reserved != 0) {
        return (resonarm_receipt){RESONARM_RESERVED, kind, NULL, reserved, 1};
    }
    return accepted(kind);
}

static resonarm_receipt decode_axes(resonarm_kind kind, const uint8_t *data, resonarm_message *message)
{
    const axes_coding *coding = resonarm_axes_coding_of(kind);
    const unsigned used = resonarm_axes_are_measured(kind) ? FLAG_X_SATURATED | FLAG_Y_SATURATED : 0u;
    resonarm_receipt receipt = check_flags(kind, data, used);
    axes values = {
        .saturated = {(data[1] & FLAG_X_SATURATED) != 0, (data[1] & FLAG_Y_SATURATED) != 0},
        .sample = get_u16(data + 6),
    };
    for (size_t axis = 0; axis < 2 && receipt.verdict == RESONARM_ACCEPTED; axis++) {
        const uint16_t word = get_u16(data + 2 + 2 * axis);
        const int32_t count = word < 0x8000u ? (int32_t)word : (int32_t)word - 0x10000;
        if (count == COUNT_NOT_AVAILABLE) {
            return (resonarm_receipt){RESONARM_NOT_AVAILABLE, kind, coding->signals[axis], 0, 0};
        }
        values.values[axis] = resonarm_value_of((int16_t)count, coding->counts_per_unit);
    }
    *message = resonarm_axes_message(kind, &values);
    return receipt;
}

static resonarm_receipt decode_operator(const uint8_t *data, resonarm_message *message)
{
    const resonarm_kind kind = RESONARM_OPERATOR_COMMAND;
    const resonarm_receipt receipt = check_flags(kind, data, 0);
    if (receipt.verdict != RESONARM_ACCEPTED) {
        return receipt;
    }
    for (uint16_t byte = 4; byte < 8; byte++) {
        if (data[byte] != 0) {
            return (resonarm_receipt){RESONARM_RESERVED, kind, NULL, data[byte], byte};
        }
    }
    if (data[2] < RESONARM_ARM || data[2] > RESONARM_RESET) {
        return unknown(kind, "request", data[2]);
    }
    if (data[3] != RESONARM_PLANT && data[3] != RESONARM_EXCITER) {
        return unknown(kind, "target", data[3]);
    }
    message->content.operator_command.request = (resonarm_request)data[2];
    message->content.operator_command.target = (resonarm_node)data[3];
    return receipt;
}

static resonarm_receipt decode_hello(resonarm_kind kind, const uint8_t *data, resonarm_message *message)
{
    const resonarm_receipt receipt = check_flags(kind, data, 0x10);
    const uint16_t rate_hz = get_u16(data + 6);
    if (receipt.verdict != RESONARM_ACCEPTED) {
        return receipt;
    }
    if (rate_hz == 0) {
        return unknown(kind, "rate_hz", 0);
    }
    message->content.hello = (resonarm_hello){
        .version_major = data[2] >> 4,
        .version_minor = data[2] & 0xFu,
        .dbc_hash = get_u16(data + 3) | (uint32_t)data[5] << 16,
        .profile = (data[1] & 0x10u) != 0 ? RESONARM_PROFILE_FD : RESONARM_PROFILE_CLASSIC,
        .rate_hz = rate_hz,
    };
    return receipt;
}

static resonarm_receipt decode_heartbeat(resonarm_kind kind, const uint8_t *data, resonarm_message *message)
{
    switch (data[0]) {
    case RESONARM_BOOT_UP:
    case RESONARM_FAULT:
    case RESONARM_OPERATIONAL:
    case RESONARM_PRE_OPERATIONAL:
        message->content.state = (resonarm_state)data[0];
        return accepted(kind);
    default:
        return unknown(kind, "state", data[0]);
    }
}

static resonarm_receipt decode_emergency(resonarm_kind kind, const uint8_t *data, resonarm_message *message)
{
    const resonarm_receipt receipt = check_flags(kind, data, 0);
    const uint16_t code = get_u16(data + 2);
    if (receipt.verdict != RESONARM_ACCEPTED) {
        return receipt;
    }
    if (code < RESONARM_COMMAND_TIMEOUT || code > RESONARM_EXCITER_TRIPPED) {
        return unknown(kind, "code", code);
    }
    message->content.emergency = (resonarm_emergency){(resonarm_code)code, get_u16(data + 4), get_u16(data + 6)};
    return receipt;
}

/* The content of a classical frame. */
static resonarm_receipt decode_classic(resonarm_kind kind, const uint8_t *data, resonarm_message *message)
{
    switch (kind) {
    case RESONARM_OPERATOR_COMMAND:
        return decode_operator(data, message);
    case RESONARM_PLANT_HELLO:
    case RESONARM_EXCITER_HELLO:
        return decode_hello(kind, data, message);
    case RESONARM_PLANT_HEARTBEAT:
    case RESONARM_EXCITER_HEARTBEAT:
        return decode_heartbeat(kind, data, message);
    case RESONARM_PLANT_EMERGENCY:
    case RESONARM_EXCITER_EMERGENCY:
        return decode_emergency(kind, data, message);
    default:
        return decode_axes(kind, data, message);
    }
}

/* The content of a frame whose form and protection are right. */
static resonarm_receipt decode_content(resonarm_kind kind, const resonarm_frame *frame, resonarm_message *message)
{
#ifndef RESONARM_CLASSIC_ONLY
    if (frame->format == RESONARM_FRAME_FD) {
        return resonarm_fd_decode(kind, frame->data, message);
    }
#endif
    return decode_classic(kind, frame->data, message);
}

/* The protection of a frame: the CRC received, the CRC expected, and the counter. */
typedef struct {
    uint16_t got;
    uint16_t crc;
    uint8_t counter;
    uint8_t counter_max;
} protection;

static protection protection_of(const resonarm_network network, resonarm_kind kind, const resonarm_frame *frame)
{
    const uint16_t data_id = resonarm_data_id(network, kind);
    const uint8_t *data = frame->data;
#ifndef RESONARM_CLASSIC_ONLY
    if (frame->format == RESONARM_FRAME_FD) {
        const uint16_t crc = resonarm_e2e_p5_crc(data_id, data, frame->length);
        return (protection){get_u16(data), crc, data[2], E2E_P5_COUNTER_MAX};
    }
#endif
    return (protection){data[0], resonarm_e2e_p11_crc(data_id, data), data[1] & 0xFu, E2E_P11_COUNTER_MAX};
}

/* CRC, then counter. */
static resonarm_receipt check_protection(resonarm_receiver *receiver, resonarm_kind kind, const resonarm_frame *frame)
{
    const protection found = protection_of(receiver->network, kind, frame);
    if (found.crc != found.got) {
        return (resonarm_receipt){RESONARM_BAD_CRC, kind, NULL, found.got, found.crc};
    }
    uint8_t lost;
    resonarm_supervision *supervision = &receiver->supervisions[kind];
    const uint8_t last = supervision->last;
    const resonarm_verdict verdict = resonarm_e2e_supervise(supervision, found.counter, found.counter_max, &lost);
    receiver->lost += lost;
    return (resonarm_receipt){verdict, kind, NULL, found.counter, verdict == RESONARM_WRONG_SEQUENCE ? last : 0};
}

static void restart(resonarm_receiver *receiver, resonarm_node node)
{
    for (int kind = 0; kind < RESONARM_KINDS; kind++) {
        if (resonarm_sender((resonarm_kind)kind) == node) {
            receiver->supervisions[kind] = (resonarm_supervision){false, 0};
        }
    }
}

/* The kind of the frame's identifier; RESONARM_KINDS if it is not the protocol's. */
static int kind_of(resonarm_network network, const resonarm_frame *frame)
{
    int kind = 0;
    while (kind < RESONARM_KINDS && resonarm_identifier(network, (resonarm_kind)kind) != frame->id) {
        kind++;
    }
    return frame->id_format == RESONARM_ID_STANDARD ? kind : RESONARM_KINDS;
}

void resonarm_receiver_init(resonarm_receiver *receiver, resonarm_network network)
{
    *receiver = (resonarm_receiver){.network = network};
}

resonarm_receipt resonarm_accept(resonarm_receiver *receiver, const resonarm_frame *frame, resonarm_message *message)
{
    const int found = kind_of(receiver->network, frame);
    if (found == RESONARM_KINDS) {
        return (resonarm_receipt){RESONARM_IGNORED, RESONARM_OPERATOR_COMMAND, NULL, 0, 0};
    }
    const resonarm_kind kind = (resonarm_kind)found;
    const resonarm_profile profile = receiver->network.profile;
    const resonarm_frame_format format = resonarm_format(profile, kind);
    const uint8_t length = resonarm_length(profile, kind);
    if (length == 0) {
        return (resonarm_receipt){RESONARM_NOT_IN_PROFILE, kind, NULL, 0, 0};
    }
    if (frame->format != format) {
        return (resonarm_receipt){RESONARM_BAD_FORMAT, kind, NULL, 0, 0};
    }
    if (frame->length != length) {
        return (resonarm_receipt){RESONARM_BAD_LENGTH, kind, NULL, frame->length, length};
    }
    if (resonarm_data_id(receiver->network, kind) != 0) {
        const resonarm_receipt checked = check_protection(receiver, kind, frame);
        if (checked.verdict != RESONARM_ACCEPTED) {
            return checked;
        }
    }
    resonarm_message decoded = {.kind = kind};
    const resonarm_receipt receipt = decode_content(kind, frame, &decoded);
    if (receipt.verdict != RESONARM_ACCEPTED) {
        return receipt;
    }
    const bool is_heartbeat = kind == RESONARM_PLANT_HEARTBEAT || kind == RESONARM_EXCITER_HEARTBEAT;
    if (is_heartbeat && decoded.content.state == RESONARM_BOOT_UP) {
        restart(receiver, resonarm_sender(kind));
    }
    *message = decoded;
    return receipt;
}
