/*
 * Random frames for the receiver and random messages for the sender: fuzz_decoder SEED ROUNDS
 *
 * What must hold: nothing is read or written out of place, for which it is built with the sanitisers; a message that is
 * accepted is one that can be sent, with these very bytes; a message that can be sent is accepted.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "e2e.h"
#include "resonarm.h"

static uint64_t random_state;

/* xorshift64* (S. Vigna 2016, ACM Trans. Math. Softw. 42, 30). */
static uint32_t random_word(void)
{
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return (uint32_t)((random_state * UINT64_C(2685821657736338717)) >> 32);
}

static resonarm_frame random_frame(resonarm_network network)
{
    static const uint8_t lengths[] = {8, 8, 8, 8, 1, 0, 7, 64, 255};
    resonarm_frame frame = {.length = lengths[random_word() % sizeof lengths]};
    const resonarm_kind kind = (resonarm_kind)(random_word() % RESONARM_KINDS);
    const bool is_known = random_word() % 8 != 0;
    frame.id = is_known ? resonarm_identifier(network, kind) : random_word() & 0x1FFFFFFFu;
    frame.id_format = random_word() % 16 == 0 ? RESONARM_ID_EXTENDED : RESONARM_ID_STANDARD;
    frame.format = random_word() % 16 == 0 ? (resonarm_frame_format)(random_word() % 3) : RESONARM_FRAME_CLASSIC;
    for (size_t i = 0; i < 8; i++) {
        /* Small numbers often, for most enumerations are small. */
        const uint32_t word = random_word();
        frame.data[i] = (uint8_t)(word % 2 == 0 ? word >> 8 : (word >> 8) % 14);
    }
    if (is_known && random_word() % 4 != 0 && resonarm_data_id(network, kind) != 0) {
        frame.data[0] = e2e_p11_crc(resonarm_data_id(network, kind), frame.data);
    }
    return frame;
}

static bool is_sent_as(resonarm_network network, const resonarm_message *message, const resonarm_frame *frame)
{
    resonarm_transmitter transmitter;
    resonarm_frame again;
    resonarm_transmitter_init(&transmitter, network);
    transmitter.counters[message->kind] = resonarm_data_id(network, message->kind) == 0 ? 0 : frame->data[1] & 0xFu;
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

int main(int count, char **arguments)
{
    if (count != 3) {
        fprintf(stderr, "usage: %s SEED ROUNDS\n", arguments[0]);
        return 2;
    }
    random_state = strtoull(arguments[1], NULL, 10) | 1u;
    const unsigned long rounds = strtoul(arguments[2], NULL, 10);
    unsigned long accepted = 0;
    resonarm_network network;
    resonarm_receiver receiver;
    if (resonarm_network_init(&network, RESONARM_BASE_DEFAULT, 1, 2) != RESONARM_NETWORK_VALID) {
        return 1;
    }
    resonarm_receiver_init(&receiver, network);
    for (unsigned long round = 0; round < rounds; round++) {
        const resonarm_frame frame = random_frame(network);
        resonarm_message message;
        if (resonarm_accept(&receiver, &frame, &message).verdict == RESONARM_ACCEPTED) {
            accepted++;
            if (!is_sent_as(network, &message, &frame)) {
                fprintf(stderr, "round %lu: a frame was accepted that no sender sends\n", round);
                return 1;
            }
        }
        uint32_t words[sizeof message / sizeof(uint32_t)];
        for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) {
            words[i] = random_word();
        }
        memcpy(&message.content, words, sizeof message.content);
        message.kind = (resonarm_kind)(RESONARM_FORCE_COMMAND + (int)(random_word() % 2));
        if (!survives(network, &message)) {
            fprintf(stderr, "round %lu: a message was sent that no receiver accepts\n", round);
            return 1;
        }
    }
    printf("%lu frames, %lu accepted\n", rounds, accepted);
    return accepted > 0 ? 0 : 1;
}
