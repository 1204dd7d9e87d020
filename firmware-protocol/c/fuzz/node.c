/*
 * The receiver and the exciter's node under any frames and times, for libFuzzer and compatible fuzzers.
 *
 * An input: a byte whose lowest bit is the profile, then records of 5 bytes and the data: milliseconds since the record
 * before, flags (bits 0 and 1 the format, bit 2 a 29-bit identifier, bit 3 the CRC is corrected), identifier (2),
 * length. It ends the process if a frame is accepted that no sender sends, as the sanitisers do if anything is
 * read or written out of place.
 */
#include <stdlib.h>
#include <string.h>

#include "../tests/protect.h"
#include "resonarm_exciter.h"

#define RECORD 5u
#define MILLISECOND_NS UINT64_C(1000000)

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static resonarm_answer answer(void *context, const resonarm_sample *sample)
{
    (void)context;
    return (resonarm_answer){.action = RESONARM_HOLD_FORCE, .force_x_n = -sample->head.force_x_n};
}

static resonarm_frame frame_of(resonarm_network network, const uint8_t *record, size_t length)
{
    static const resonarm_frame_format formats[] = {
        RESONARM_FRAME_CLASSIC, RESONARM_FRAME_REMOTE, RESONARM_FRAME_FD, RESONARM_FRAME_CLASSIC};
    resonarm_frame frame = {
        .id = get_u16(record + 2),
        .id_format = (record[1] & 4u) != 0 ? RESONARM_ID_EXTENDED : RESONARM_ID_STANDARD,
        .format = formats[record[1] & 3u],
        .length = (uint8_t)length,
    };
    memcpy(frame.data, record + RECORD, length);
    for (int kind = 0; (record[1] & 8u) != 0 && kind < RESONARM_KINDS; kind++) {
        const bool is_kind = resonarm_identifier(network, (resonarm_kind)kind) == frame.id;
        if (is_kind && resonarm_length(network.profile, (resonarm_kind)kind) == frame.length) {
            protect(network, (resonarm_kind)kind, &frame);
        }
    }
    return frame;
}

/* An accepted frame must equal the frame that a sender makes of its message. */
static void check(resonarm_receiver *receiver, const resonarm_frame *frame)
{
    resonarm_message message;
    resonarm_frame again;
    if (resonarm_accept(receiver, frame, &message).verdict != RESONARM_ACCEPTED) {
        return;
    }
    const bool is_fd = frame->format == RESONARM_FRAME_FD;
    resonarm_transmitter transmitter;
    resonarm_transmitter_init(&transmitter, receiver->network);
    transmitter.counters[message.kind] = frame->length == 1 ? 0 : is_fd ? frame->data[2] : frame->data[1] & 0xFu;
    if (resonarm_encode(&transmitter, &message, &again).reason != RESONARM_SENDABLE || again.length != frame->length ||
        memcmp(again.data, frame->data, frame->length) != 0) {
        abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    resonarm_network network = resonarm_own_network();
    network.profile = size > 0 && (data[0] & 1u) != 0 ? RESONARM_PROFILE_FD : RESONARM_PROFILE_CLASSIC;
    const resonarm_exciter_config config = {
        .network = network,
        .rate_hz = 1000,
        .timing = resonarm_real_time(1000),
        .answer = answer,
        .capabilities = {.samples_per_frame = 2},
    };
    resonarm_exciter exciter;
    resonarm_receiver receiver;
    uint64_t now_ns = 0;
    resonarm_exciter_init(&exciter, &config);
    resonarm_exciter_start(&exciter, now_ns);
    resonarm_receiver_init(&receiver, network);
    for (size_t at = 1; at + RECORD <= size;) {
        const uint8_t *record = data + at;
        const size_t left = size - at - RECORD;
        const size_t length = (record[4] & 0x7Fu) > RESONARM_FRAME_BYTES ? RESONARM_FRAME_BYTES : record[4] & 0x7Fu;
        const resonarm_frame frame = frame_of(network, record, length < left ? length : left);
        resonarm_frame sent;
        now_ns += record[0] * MILLISECOND_NS;
        check(&receiver, &frame);
        resonarm_exciter_handle_frame(&exciter, now_ns, &frame);
        resonarm_exciter_handle_deadline(&exciter, now_ns);
        while (resonarm_exciter_next_frame(&exciter, &sent)) {
            resonarm_exciter_frame_sent(&exciter);
        }
        if (resonarm_exciter_report(&exciter).outcome == RESONARM_FAULTED) {
            (void)resonarm_exciter_rearm(&exciter, now_ns);
        }
        at += RECORD + frame.length;
    }
    return 0;
}
