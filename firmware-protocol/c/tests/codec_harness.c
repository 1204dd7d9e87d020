/*
 * The codec on standard input and output, one command per line, for a test that compares it with another codec.
 *
 *   network BASE PLANT EXCITER FD a new sender and receiver of a network     valid | base | unaligned |
 *                                                                             node-id | same | not-built
 *   encode KIND V...              the sender's next frame of a message        frame ID c|f DATA |
 *                                                                             refused REASON SIGNAL
 *   accept s|e c|r|f ID LEN DATA  the receiver's verdict on a frame           ignored | accepted KIND V... |
 *                                                                             refused REASON KIND SIGNAL GOT EXPECTED
 *   lost                          frames that the receiver counts as lost     N
 *   next STATE EVENT              the table of states                         STATE
 *   compare V... V...             two hellos                                  MISMATCH
 *   window RATE                   window and period of a rate                 SAMPLES NS
 *   constants                     the constants of the header                 N...
 *
 * FD is 0 or 1. A V is a double as the hexadecimal digits of its bits; they are in the order of the structures'
 * members.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "resonarm.h"

static resonarm_transmitter transmitter;
static resonarm_receiver receiver;

static double next_value(void)
{
    const char *word = strtok(NULL, " ");
    const uint64_t bits = word == NULL ? 0 : strtoull(word, NULL, 16);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static unsigned long next_number(int base)
{
    const char *word = strtok(NULL, " ");
    return word == NULL ? 0 : strtoul(word, NULL, base);
}

static void say_value(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    printf(" %016" PRIx64, bits);
}

static void say_axes(double x, double y, uint16_t sample)
{
    say_value(x);
    say_value(y);
    say_value(sample);
}

static resonarm_hello next_hello(void)
{
    resonarm_hello hello;
    hello.version_major = (uint8_t)next_value();
    hello.version_minor = (uint8_t)next_value();
    hello.dbc_hash = (uint32_t)next_value();
    hello.profile = (resonarm_profile)(int)next_value();
    hello.rate_hz = (uint16_t)next_value();
    return hello;
}

#ifndef RESONARM_CLASSIC_ONLY
static resonarm_readings next_readings(void)
{
    resonarm_readings readings;
    for (int i = 0; i < RESONARM_READINGS; i++) {
        readings.values[i] = next_value();
    }
    for (int i = 0; i < RESONARM_READINGS; i++) {
        readings.saturated[i] = next_value() > 0.0;
    }
    return readings;
}

static void say_readings(const resonarm_readings *readings)
{
    for (int i = 0; i < RESONARM_READINGS; i++) {
        say_value(readings->values[i]);
    }
    for (int i = 0; i < RESONARM_READINGS; i++) {
        say_value(readings->saturated[i]);
    }
}
#endif

static void read_axes(resonarm_message *message)
{
    const double x = next_value(), y = next_value();
    if (message->kind == RESONARM_FORCE_COMMAND) {
        message->content.force = (resonarm_force_command){x, y, (uint16_t)next_value()};
        return;
    }
    if (message->kind == RESONARM_TORQUE_COMMAND) {
        message->content.torque = (resonarm_torque_command){x, y, (uint16_t)next_value()};
        return;
    }
    const bool x_saturated = next_value() > 0.0, y_saturated = next_value() > 0.0;
    const uint16_t sample = (uint16_t)next_value();
    if (message->kind == RESONARM_IMPEDANCE_HEAD) {
        message->content.head = (resonarm_impedance_head){x, y, x_saturated, y_saturated, sample};
    } else {
        message->content.acceleration = (resonarm_acceleration){x, y, x_saturated, y_saturated, sample};
    }
}

static resonarm_message read_message(void)
{
    resonarm_message message = {.kind = (resonarm_kind)next_number(10)};
    switch (message.kind) {
    case RESONARM_OPERATOR_COMMAND:
        message.content.operator_command.request = (resonarm_request)(int)next_value();
        message.content.operator_command.target = (resonarm_node)(int)next_value();
        break;
    case RESONARM_PLANT_HELLO:
    case RESONARM_EXCITER_HELLO:
        message.content.hello = next_hello();
        break;
    case RESONARM_PLANT_HEARTBEAT:
    case RESONARM_EXCITER_HEARTBEAT:
        message.content.state = (resonarm_state)(int)next_value();
        break;
    case RESONARM_PLANT_EMERGENCY:
    case RESONARM_EXCITER_EMERGENCY:
        message.content.emergency.code = (resonarm_code)(int)next_value();
        message.content.emergency.detail = (uint16_t)next_value();
        message.content.emergency.sample = (uint16_t)next_value();
        break;
#ifndef RESONARM_CLASSIC_ONLY
    case RESONARM_SENSORS:
        message.content.sensors.readings = next_readings();
        message.content.sensors.sample = (uint16_t)next_value();
        break;
    case RESONARM_SENSOR_PAIR:
        message.content.pair.readings[0] = next_readings();
        message.content.pair.readings[1] = next_readings();
        message.content.pair.sample = (uint16_t)next_value();
        break;
    case RESONARM_PLANT_CAPABILITIES:
    case RESONARM_EXCITER_CAPABILITIES:
        message.content.capabilities.samples_per_frame = (uint8_t)next_value();
        message.content.capabilities.force_limit_n = next_value();
        message.content.capabilities.torque_limit_nm = next_value();
        break;
#endif
    default:
        read_axes(&message);
    }
    return message;
}

static void say_message(const resonarm_message *message)
{
    const resonarm_force_command *force = &message->content.force;
    const resonarm_torque_command *torque = &message->content.torque;
    const resonarm_impedance_head *head = &message->content.head;
    const resonarm_acceleration *acceleration = &message->content.acceleration;
    const resonarm_hello *hello = &message->content.hello;
    const resonarm_emergency *emergency = &message->content.emergency;
    printf("accepted %d", (int)message->kind);
    switch (message->kind) {
    case RESONARM_OPERATOR_COMMAND:
        say_value(message->content.operator_command.request);
        say_value(message->content.operator_command.target);
        break;
    case RESONARM_FORCE_COMMAND:
        say_axes(force->force_x_n, force->force_y_n, force->sample);
        break;
    case RESONARM_TORQUE_COMMAND:
        say_axes(torque->torque1_nm, torque->torque2_nm, torque->sample);
        break;
    case RESONARM_IMPEDANCE_HEAD:
        say_value(head->force_x_n);
        say_value(head->force_y_n);
        say_axes(head->x_saturated, head->y_saturated, head->sample);
        break;
    case RESONARM_ACCELEROMETER_B:
    case RESONARM_ACCELEROMETER_C:
        say_value(acceleration->acceleration_x_m_s2);
        say_value(acceleration->acceleration_y_m_s2);
        say_axes(acceleration->x_saturated, acceleration->y_saturated, acceleration->sample);
        break;
    case RESONARM_PLANT_HELLO:
    case RESONARM_EXCITER_HELLO:
        say_value(hello->version_major);
        say_value(hello->version_minor);
        say_value(hello->dbc_hash);
        say_value(hello->profile);
        say_value(hello->rate_hz);
        break;
    case RESONARM_PLANT_HEARTBEAT:
    case RESONARM_EXCITER_HEARTBEAT:
        say_value(message->content.state);
        break;
    case RESONARM_PLANT_EMERGENCY:
    case RESONARM_EXCITER_EMERGENCY:
        say_axes(emergency->code, emergency->detail, emergency->sample);
        break;
#ifndef RESONARM_CLASSIC_ONLY
    case RESONARM_SENSORS:
        say_readings(&message->content.sensors.readings);
        say_value(message->content.sensors.sample);
        break;
    case RESONARM_SENSOR_PAIR:
        say_readings(&message->content.pair.readings[0]);
        say_readings(&message->content.pair.readings[1]);
        say_value(message->content.pair.sample);
        break;
    case RESONARM_PLANT_CAPABILITIES:
    case RESONARM_EXCITER_CAPABILITIES:
        say_value(message->content.capabilities.samples_per_frame);
        say_value(message->content.capabilities.force_limit_n);
        say_value(message->content.capabilities.torque_limit_nm);
        break;
#endif
    default:
        break;
    }
    printf("\n");
}

static void encode(void)
{
    static const char *const reasons[] = {"sendable", "not-finite", "out-of-range", "invalid", "negative", "profile"};
    const resonarm_message message = read_message();
    resonarm_frame frame;
    const resonarm_encoding encoding = resonarm_encode(&transmitter, &message, &frame);
    if (encoding.reason != RESONARM_SENDABLE) {
        printf("refused %s %s", reasons[encoding.reason], encoding.signal == NULL ? "-" : encoding.signal);
        say_value(encoding.got);
        say_value(encoding.min);
        say_value(encoding.max);
        printf("\n");
        return;
    }
    resonarm_frame_taken(&transmitter, message.kind);
    printf("frame %" PRIX32 " %c ", frame.id, frame.format == RESONARM_FRAME_FD ? 'f' : 'c');
    for (int i = 0; i < frame.length; i++) {
        printf("%02X", frame.data[i]);
    }
    printf("\n");
}

static resonarm_frame read_frame(void)
{
    const char *id_format = strtok(NULL, " "), *format = strtok(NULL, " ");
    resonarm_frame frame = {.id = (uint32_t)next_number(16), .length = (uint8_t)next_number(10)};
    const char *data = strtok(NULL, " ");
    frame.id_format = id_format != NULL && id_format[0] == 'e' ? RESONARM_ID_EXTENDED : RESONARM_ID_STANDARD;
    if (format != NULL && format[0] != 'c') {
        frame.format = format[0] == 'r' ? RESONARM_FRAME_REMOTE : RESONARM_FRAME_FD;
    }
    for (size_t i = 0; data != NULL && i < RESONARM_FRAME_BYTES && 2 * i + 1 < strlen(data); i++) {
        const char digits[3] = {data[2 * i], data[2 * i + 1], 0};
        frame.data[i] = (uint8_t)strtoul(digits, NULL, 16);
    }
    return frame;
}

static void accept(void)
{
    static const char *const verdicts[] = {
        "accepted",       "ignored",         "profile",  "format",        "length",       "crc", "repeated",
        "wrong-sequence", "invalid-counter", "reserved", "not-available", "not-finite",   "negative", "unknown-value",
    };
    const resonarm_frame frame = read_frame();
    resonarm_message message;
    const resonarm_receipt receipt = resonarm_accept(&receiver, &frame, &message);
    if (receipt.verdict == RESONARM_ACCEPTED) {
        say_message(&message);
    } else if (receipt.verdict == RESONARM_IGNORED) {
        printf("ignored\n");
    } else {
        printf("refused %s %d %s %u %u\n", verdicts[receipt.verdict], (int)receipt.kind,
               receipt.signal == NULL ? "-" : receipt.signal, receipt.got, receipt.expected);
    }
}

static void begin(void)
{
    static const char *const checks[] = {"valid", "base", "unaligned", "node-id", "same", "not-built"};
    resonarm_network network;
    const uint16_t base = (uint16_t)next_number(10);
    const uint8_t plant_id = (uint8_t)next_number(10), exciter_id = (uint8_t)next_number(10);
    const resonarm_profile profile = next_number(10) == 0 ? RESONARM_PROFILE_CLASSIC : RESONARM_PROFILE_FD;
    const resonarm_network_check check = resonarm_network_init(&network, base, plant_id, exciter_id, profile);
    if (check == RESONARM_NETWORK_VALID) {
        resonarm_transmitter_init(&transmitter, network);
        resonarm_receiver_init(&receiver, network);
    }
    printf("%s\n", checks[check]);
}

static void constants(void)
{
    const uint64_t all[] = {
        RESONARM_PROTOCOL_VERSION, RESONARM_DBC_HASH_CLASSIC, RESONARM_DBC_HASH_FD, RESONARM_BASE_MIN,
        RESONARM_BASE_MAX, RESONARM_KINDS, RESONARM_HEARTBEAT_PERIOD_NS, RESONARM_HEARTBEAT_TIMEOUT_NS,
        RESONARM_HELLO_PERIOD_NS, RESONARM_COMMAND_TIMEOUT_NS, RESONARM_COMMAND_AGE_NS, RESONARM_FORCE_RAMP_NS,
        RESONARM_LOCKSTEP_TIMEOUT_NS, RESONARM_LOCKSTEP_LOOK_NS, RESONARM_REAL_TIME_RATE_MIN_HZ,
        RESONARM_STALE_SAMPLES_LIMIT, RESONARM_SAMPLE_WINDOW_MIN, RESONARM_NODE_ID_MAX,
    };
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) {
        printf("%s%" PRIu64, i == 0 ? "" : " ", all[i]);
    }
    printf("\n");
}

static void execute(const char *command)
{
    if (strcmp(command, "network") == 0) {
        begin();
    } else if (strcmp(command, "encode") == 0) {
        encode();
    } else if (strcmp(command, "accept") == 0) {
        accept();
    } else if (strcmp(command, "lost") == 0) {
        printf("%" PRIu64 "\n", receiver.lost);
    } else if (strcmp(command, "next") == 0) {
        const resonarm_state state = (resonarm_state)next_number(10);
        printf("%d\n", (int)resonarm_next_state(state, (resonarm_event)next_number(10)));
    } else if (strcmp(command, "compare") == 0) {
        const resonarm_hello own = next_hello(), partner = next_hello();
        printf("%d\n", (int)resonarm_compare_hellos(&own, &partner));
    } else if (strcmp(command, "window") == 0) {
        const uint16_t rate_hz = (uint16_t)next_number(10);
        printf("%u %" PRIu64 "\n", resonarm_sample_window(rate_hz), resonarm_sample_period_ns(rate_hz));
    } else if (strcmp(command, "constants") == 0) {
        constants();
    } else {
        printf("no command %s\n", command);
    }
}

int main(void)
{
    char line[1024];
    while (fgets(line, sizeof line, stdin) != NULL) {
        line[strcspn(line, "\n")] = 0;
        const char *command = strtok(line, " ");
        if (command != NULL) {
            execute(command);
            fflush(stdout);
        }
    }
    return 0;
}
