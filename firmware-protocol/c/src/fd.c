#include "fd.h"

#include "axes.h"
#include "bytes.h"
#include "single.h"

#ifndef RESONARM_CLASSIC_ONLY

/* Offsets in a frame: CRC and counter in the bytes 0 to 2, then these. */
enum { FLAGS = 3, SAMPLES_PER_FRAME = 3, SAMPLE = 4, SECOND_FLAGS = 6, SINGLES = 8, SECOND_SINGLES = 32 };
/* Bytes of SensorPair, of which the last are zero. */
enum { PAIR_USED = 56, PAIR_BYTES = 64 };

/* Flags of a sample: one for each reading, in their order. */
#define SATURATED 0x3Fu

static const char *const reading_names[RESONARM_READINGS] = {
    "force_x_n",             "force_y_n",             "acceleration_b_x_m_s2",
    "acceleration_b_y_m_s2", "acceleration_c_x_m_s2", "acceleration_c_y_m_s2",
};
static const char *const limit_names[2] = {"force_limit_n", "torque_limit_nm"};

static resonarm_encoding refused(resonarm_encode_reason reason, const char *signal, double got)
{
    return (resonarm_encoding){reason, signal, got, -SINGLE_MAX, SINGLE_MAX};
}

static resonarm_encoding sendable(void)
{
    return (resonarm_encoding){RESONARM_SENDABLE, NULL, 0.0, 0.0, 0.0};
}

/* A value that is never clipped. */
static resonarm_encoding put_commanded(uint8_t *at, const char *signal, double value)
{
    switch (resonarm_put_single(at, value)) {
    case SINGLE_NOT_FINITE:
        return refused(RESONARM_NOT_FINITE, signal, value);
    case SINGLE_BEYOND:
        return refused(RESONARM_OUT_OF_RANGE, signal, value);
    case SINGLE_IN_RANGE:
        break;
    }
    return sendable();
}

static resonarm_encoding encode_command(const resonarm_message *message, uint8_t *content)
{
    const axes_coding *coding = resonarm_axes_coding_of(message->kind);
    const axes values = resonarm_axes_of(message);
    resonarm_encoding encoding = sendable();
    put_u16(content + SAMPLE, values.sample);
    for (size_t axis = 0; axis < 2 && encoding.reason == RESONARM_SENDABLE; axis++) {
        uint8_t *at = content + SINGLES + SINGLE_BYTES * axis;
        encoding = put_commanded(at, coding->signals[axis], values.values[axis]);
    }
    return encoding;
}

static resonarm_encoding encode_readings(const resonarm_readings *readings, uint8_t *singles, uint8_t *flags)
{
    for (size_t i = 0; i < RESONARM_READINGS; i++) {
        const single_range range = resonarm_put_single(singles + SINGLE_BYTES * i, readings->values[i]);
        if (range == SINGLE_NOT_FINITE) {
            return refused(RESONARM_NOT_FINITE, reading_names[i], readings->values[i]);
        }
        if (range == SINGLE_BEYOND || readings->saturated[i]) {
            *flags |= (uint8_t)(1u << i);
        }
    }
    return sendable();
}

static resonarm_encoding encode_pair(const resonarm_sensor_pair *pair, uint8_t *content)
{
    put_u16(content + SAMPLE, pair->sample);
    const resonarm_encoding encoding = encode_readings(&pair->readings[0], content + SINGLES, content + FLAGS);
    if (encoding.reason != RESONARM_SENDABLE) {
        return encoding;
    }
    return encode_readings(&pair->readings[1], content + SECOND_SINGLES, content + SECOND_FLAGS);
}

static resonarm_encoding encode_capabilities(const resonarm_capabilities *capabilities, uint8_t *content)
{
    const double limits[2] = {capabilities->force_limit_n, capabilities->torque_limit_nm};
    const uint8_t samples = capabilities->samples_per_frame;
    if (samples < 1 || samples > 2) {
        return (resonarm_encoding){RESONARM_INVALID, "samples_per_frame", samples, 1.0, 2.0};
    }
    content[SAMPLES_PER_FRAME] = samples;
    for (size_t i = 0; i < 2; i++) {
        double rounded;
        uint8_t *at = content + SINGLES + SINGLE_BYTES * i;
        const resonarm_encoding encoding = put_commanded(at, limit_names[i], limits[i]);
        if (encoding.reason != RESONARM_SENDABLE) {
            return encoding;
        }
        if (resonarm_get_single(at, &rounded) && rounded < 0.0) {
            return (resonarm_encoding){RESONARM_NEGATIVE, limit_names[i], limits[i], 0.0, SINGLE_MAX};
        }
    }
    return sendable();
}

resonarm_encoding resonarm_fd_encode(const resonarm_message *message, uint8_t *content)
{
    switch (message->kind) {
    case RESONARM_SENSORS:
        put_u16(content + SAMPLE, message->content.sensors.sample);
        return encode_readings(&message->content.sensors.readings, content + SINGLES, content + FLAGS);
    case RESONARM_SENSOR_PAIR:
        return encode_pair(&message->content.pair, content);
    case RESONARM_PLANT_CAPABILITIES:
    case RESONARM_EXCITER_CAPABILITIES:
        return encode_capabilities(&message->content.capabilities, content);
    default:
        return encode_command(message, content);
    }
}

static resonarm_receipt accepted(resonarm_kind kind)
{
    return (resonarm_receipt){RESONARM_ACCEPTED, kind, NULL, 0, 0};
}

/* Rejects content in the bytes from `begin` to before `end`. */
static resonarm_receipt check_zero(resonarm_kind kind, const uint8_t *data, uint16_t begin, uint16_t end)
{
    for (uint16_t byte = begin; byte < end; byte++) {
        if (data[byte] != 0) {
            return (resonarm_receipt){RESONARM_RESERVED, kind, NULL, data[byte], byte};
        }
    }
    return accepted(kind);
}

static resonarm_receipt decode_command(resonarm_kind kind, const uint8_t *data, resonarm_message *message)
{
    const axes_coding *coding = resonarm_axes_coding_of(kind);
    axes values = {.sample = get_u16(data + SAMPLE)};
    resonarm_receipt receipt = check_zero(kind, data, FLAGS, SAMPLE);
    if (receipt.verdict == RESONARM_ACCEPTED) {
        receipt = check_zero(kind, data, SAMPLE + 2, SINGLES);
    }
    for (size_t axis = 0; axis < 2 && receipt.verdict == RESONARM_ACCEPTED; axis++) {
        if (!resonarm_get_single(data + SINGLES + SINGLE_BYTES * axis, &values.values[axis])) {
            receipt = (resonarm_receipt){RESONARM_VALUE_NOT_FINITE, kind, coding->signals[axis], 0, 0};
        }
    }
    *message = resonarm_axes_message(kind, &values);
    return receipt;
}

static resonarm_receipt decode_readings(
    resonarm_kind kind, const uint8_t *data, uint16_t singles, uint16_t flags, resonarm_readings *readings)
{
    const uint8_t reserved = (uint8_t)(data[flags] & ~SATURATED);
    if (reserved != 0) {
        return (resonarm_receipt){RESONARM_RESERVED, kind, NULL, reserved, flags};
    }
    for (size_t i = 0; i < RESONARM_READINGS; i++) {
        readings->saturated[i] = (data[flags] >> i & 1u) != 0;
        if (!resonarm_get_single(data + singles + SINGLE_BYTES * i, &readings->values[i])) {
            return (resonarm_receipt){RESONARM_VALUE_NOT_FINITE, kind, reading_names[i], 0, 0};
        }
    }
    return accepted(kind);
}

static resonarm_receipt decode_sensors(const uint8_t *data, resonarm_sensors *sensors)
{
    const resonarm_kind kind = RESONARM_SENSORS;
    const resonarm_receipt receipt = check_zero(kind, data, SAMPLE + 2, SINGLES);
    sensors->sample = get_u16(data + SAMPLE);
    return receipt.verdict == RESONARM_ACCEPTED ? decode_readings(kind, data, SINGLES, FLAGS, &sensors->readings)
                                                : receipt;
}

static resonarm_receipt decode_pair(const uint8_t *data, resonarm_sensor_pair *pair)
{
    const resonarm_kind kind = RESONARM_SENSOR_PAIR;
    resonarm_receipt receipt = check_zero(kind, data, SECOND_FLAGS + 1, SINGLES);
    pair->sample = get_u16(data + SAMPLE);
    if (receipt.verdict == RESONARM_ACCEPTED) {
        receipt = check_zero(kind, data, PAIR_USED, PAIR_BYTES);
    }
    if (receipt.verdict == RESONARM_ACCEPTED) {
        receipt = decode_readings(kind, data, SINGLES, FLAGS, &pair->readings[0]);
    }
    if (receipt.verdict == RESONARM_ACCEPTED) {
        receipt = decode_readings(kind, data, SECOND_SINGLES, SECOND_FLAGS, &pair->readings[1]);
    }
    return receipt;
}

static resonarm_receipt decode_capabilities(
    resonarm_kind kind, const uint8_t *data, resonarm_capabilities *capabilities)
{
    const resonarm_receipt receipt = check_zero(kind, data, SAMPLES_PER_FRAME + 1, SINGLES);
    double limits[2] = {0.0, 0.0};
    if (receipt.verdict != RESONARM_ACCEPTED) {
        return receipt;
    }
    if (data[SAMPLES_PER_FRAME] < 1 || data[SAMPLES_PER_FRAME] > 2) {
        const uint16_t got = data[SAMPLES_PER_FRAME];
        return (resonarm_receipt){RESONARM_UNKNOWN_VALUE, kind, "samples_per_frame", got, 0};
    }
    for (size_t i = 0; i < 2; i++) {
        if (!resonarm_get_single(data + SINGLES + SINGLE_BYTES * i, &limits[i])) {
            return (resonarm_receipt){RESONARM_VALUE_NOT_FINITE, kind, limit_names[i], 0, 0};
        }
        if (limits[i] < 0.0) {
            return (resonarm_receipt){RESONARM_VALUE_NEGATIVE, kind, limit_names[i], 0, 0};
        }
    }
    *capabilities = (resonarm_capabilities){data[SAMPLES_PER_FRAME], limits[0], limits[1]};
    return receipt;
}

resonarm_receipt resonarm_fd_decode(resonarm_kind kind, const uint8_t *data, resonarm_message *message)
{
    switch (kind) {
    case RESONARM_SENSORS:
        return decode_sensors(data, &message->content.sensors);
    case RESONARM_SENSOR_PAIR:
        return decode_pair(data, &message->content.pair);
    case RESONARM_PLANT_CAPABILITIES:
    case RESONARM_EXCITER_CAPABILITIES:
        return decode_capabilities(kind, data, &message->content.capabilities);
    default:
        return decode_command(kind, data, message);
    }
}

#endif
