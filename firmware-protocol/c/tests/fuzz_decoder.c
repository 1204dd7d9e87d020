/*
 * Random frames for the receiver and random messages for the sender: fuzz_decoder SEED ROUNDS
 *
 * Checks: nothing is read or written out of bounds, for which it is built with the sanitisers; a message that is
 * accepted is one that can be sent, with these very bytes; a message that can be sent is accepted.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "protect.h"
#include "random.h"
#include "resonarm.h"

/* Bits without a signal are mostly zero, so that long frames can pass. */
static void clear_reserved(resonarm_kind kind, resonarm_frame *frame)
{
    const size_t begin = kind == RESONARM_SENSOR_PAIR ? 7 : 6;
    if (frame->format != RESONARM_FRAME_FD || random_word() % 8 == 0) {
        return;
    }
    memset(frame->data + begin, 0, 8 - begin);
    memset(frame->data + 56, 0, 8);
    if (kind == RESONARM_FORCE_COMMAND || kind == RESONARM_TORQUE_COMMAND) {
        frame->data[3] = 0;
    } else if (kind == RESONARM_PLANT_CAPABILITIES || kind == RESONARM_EXCITER_CAPABILITIES) {
        frame->data[3] &= 3;
        memset(frame->data + 4, 0, 2);
    } else {
        frame->data[3] &= 0x3F;
        frame->data[6] &= 0x3F;
    }
}

static resonarm_frame random_frame(resonarm_network network)
{
    static const uint8_t lengths[] = {8, 1, 0, 7, 16, 64, 255};
    const resonarm_kind kind = (resonarm_kind)(random_word() % RESONARM_KINDS);
    resonarm_frame frame = {.length = resonarm_length(network.profile, kind)};
    const bool is_known = random_word() % 8 != 0;
    frame.id = is_known ? resonarm_identifier(network, kind) : random_word() & 0x1FFFFFFFu;
    frame.id_format = random_word() % 16 == 0 ? RESONARM_ID_EXTENDED : RESONARM_ID_STANDARD;
    frame.format = resonarm_format(network.profile, kind);
    if (random_word() % 8 == 0) {
        frame.format = (resonarm_frame_format)(random_word() % 3);
        frame.length = lengths[random_word() % sizeof lengths];
    }
    for (size_t i = 0; i < RESONARM_FRAME_BYTES; i++) {
        /* Often small numbers, since most enumerations are small. */
        const uint32_t word = random_word();
        frame.data[i] = (uint8_t)(word % 2 == 0 ? word >> 8 : (word >> 8) % 14);
    }
    clear_reserved(kind, &frame);
    if (is_known && random_word() % 4 != 0) {
        protect(network, kind, &frame);
    }
    return frame;
}

static bool is_sent_as(resonarm_network network, const resonarm_message *message, const resonarm_frame *frame)
{
    resonarm_transmitter transmitter;
    resonarm_frame again;
    resonarm_transmitter_init(&transmitter, network);
    if (frame->format == RESONARM_FRAME_FD) {
        transmitter.counters[message->kind] = frame->data[2];
    } else if (resonarm_data_id(network, message->kind) != 0) {
        transmitter.counters[message->kind] = frame->data[1] & 0xFu;
    }
    if (resonarm_encode(&transmitter, message, &again).reason != RESONARM_SENDABLE) {
        return false;
    }
    return again.length == frame->length && memcmp(again.data, frame->data, frame->length) == 0;
}

static bool survives(resonarm_network network, const resonarm_message *message)
{
    resonarm_transmitter transmitter;
    resonarm_receiver receiver;
    resonarm_frame frame;
    resonarm_message received;
    resonarm_transmitter_init(&transmitter, network);
    resonarm_receiver_init(&receiver, network);
    if (resonarm_encode(&transmitter, message, &frame).reason != RESONARM_SENDABLE) {
        return true;
    }
    return resonarm_accept(&receiver, &frame, &received).verdict == RESONARM_ACCEPTED;
}

/* A message whose numbers may be anything. */
static resonarm_message random_message(void)
{
    static const resonarm_kind kinds[] = {
        RESONARM_FORCE_COMMAND, RESONARM_TORQUE_COMMAND,     RESONARM_IMPEDANCE_HEAD,       RESONARM_ACCELEROMETER_B,
        RESONARM_SENSORS,       RESONARM_SENSOR_PAIR,        RESONARM_EXCITER_CAPABILITIES, RESONARM_ACCELEROMETER_C,
    };
    double numbers[2 * RESONARM_READINGS];
    resonarm_message message = {.kind = kinds[random_word() % (sizeof kinds / sizeof kinds[0])]};
    for (size_t i = 0; i < 2 * RESONARM_READINGS; i++) {
        const uint64_t bits = (uint64_t)random_word() << 32 | random_word();
        if (random_word() % 2 == 0) {
            memcpy(&numbers[i], &bits, sizeof bits);
        } else {
            numbers[i] = (double)(int32_t)(bits % 4000000) * 1e-3 - 2000.0;
        }
    }
    if (message.kind == RESONARM_SENSORS || message.kind == RESONARM_SENSOR_PAIR) {
        memcpy(&message.content.pair.readings[0].values, numbers, sizeof message.content.pair.readings[0].values);
        memcpy(&message.content.pair.readings[1].values, numbers + RESONARM_READINGS,
               sizeof message.content.pair.readings[1].values);
    } else if (message.kind == RESONARM_EXCITER_CAPABILITIES) {
        message.content.capabilities =
            (resonarm_capabilities){(uint8_t)(random_word() % 4), numbers[0], numbers[1]};
    } else if (message.kind == RESONARM_IMPEDANCE_HEAD) {
        message.content.head = (resonarm_impedance_head){numbers[0], numbers[1], true, false, 3};
    } else if (message.kind == RESONARM_FORCE_COMMAND || message.kind == RESONARM_TORQUE_COMMAND) {
        message.content.force = (resonarm_force_command){numbers[0], numbers[1], (uint16_t)random_word()};
    } else {
        message.content.acceleration = (resonarm_acceleration){numbers[0], numbers[1], false, true, 5};
    }
    return message;
}

/* How many of the frames were accepted; -1 if a check fails. */
static long run(resonarm_profile profile, unsigned long rounds)
{
    long accepted = 0;
    resonarm_network network = resonarm_own_network();
    resonarm_receiver receiver;
    network.profile = profile;
    for (unsigned long round = 0; round < rounds; round++) {
        /* Half of the time a new one, which accepts any counter. */
        if (round == 0 || random_word() % 2 == 0) {
            resonarm_receiver_init(&receiver, network);
        }
        const resonarm_frame frame = random_frame(network);
        resonarm_message message;
        if (resonarm_accept(&receiver, &frame, &message).verdict == RESONARM_ACCEPTED) {
            accepted++;
            if (!is_sent_as(network, &message, &frame)) {
                fprintf(stderr, "round %lu: a frame was accepted that no sender sends\n", round);
                return -1;
            }
        }
        message = random_message();
        if (!survives(network, &message)) {
            fprintf(stderr, "round %lu: a message was sent that no receiver accepts\n", round);
            return -1;
        }
    }
    return accepted;
}

int main(int count, char **arguments)
{
    if (count != 3) {
        fprintf(stderr, "usage: %s SEED ROUNDS\n", arguments[0]);
        return 2;
    }
    random_state = strtoull(arguments[1], NULL, 10) | 1u;
    const unsigned long rounds = strtoul(arguments[2], NULL, 10);
    const long classic = run(RESONARM_PROFILE_CLASSIC, rounds), fd = run(RESONARM_PROFILE_FD, rounds);
    printf("%ld classic and %ld FD frames of %lu each accepted\n", classic, fd, rounds);
    return classic > 0 && fd > 0 ? 0 : 1;
}
