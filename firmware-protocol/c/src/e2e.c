#include "e2e.h"

/*
 * The polynomial is x^8 + x^4 + x^3 + x^2 + 1, most significant bit first, start 0, no final XOR. Four bits at a time:
 * with the remainder r = 16 h + l, h and l of four bits, r x^4 = h x^8 + 16 l, and h x^8 mod P is table[h].
 */
static uint8_t crc_of(uint8_t crc, uint8_t byte)
{
    static const uint8_t table[16] = {0x00, 0x1D, 0x3A, 0x27, 0x74, 0x69, 0x4E, 0x53,
                                      0xE8, 0xF5, 0xD2, 0xCF, 0x9C, 0x81, 0xA6, 0xBB};
    unsigned remainder = (unsigned)crc ^ byte;
    remainder = ((remainder << 4) & 0xFFu) ^ table[remainder >> 4];
    remainder = ((remainder << 4) & 0xFFu) ^ table[remainder >> 4];
    return (uint8_t)remainder;
}

uint8_t resonarm_e2e_p11_crc(uint16_t data_id, const uint8_t *data)
{
    uint8_t crc = crc_of(crc_of(0, (uint8_t)(data_id & 0xFFu)), (uint8_t)(data_id >> 8));
    for (size_t i = 1; i < E2E_P11_BYTES; i++) {
        crc = crc_of(crc, data[i]);
    }
    return crc;
}

#ifndef RESONARM_CLASSIC_ONLY

/*
 * The polynomial is x^16 + x^12 + x^5 + 1, most significant bit first, start 0xFFFF, no final XOR. Four bits at a time:
 * with the remainder r = 4096 h + l, h of four bits, r x^4 = h x^16 + 16 l, and h x^16 mod P is h (x^12 + x^5 + 1).
 */
static uint16_t crc16_of(uint16_t crc, uint8_t byte)
{
    unsigned remainder = (unsigned)crc ^ (unsigned)byte << 8;
    for (int half = 0; half < 2; half++) {
        const unsigned high = remainder >> 12;
        remainder = ((remainder << 4) & 0xFFFFu) ^ (high << 12 | high << 5 | high);
    }
    return (uint16_t)remainder;
}

uint16_t resonarm_e2e_p5_crc(uint16_t data_id, const uint8_t *data, size_t length)
{
    uint16_t crc = 0xFFFFu;
    for (size_t i = 2; i < length; i++) {
        crc = crc16_of(crc, data[i]);
    }
    return crc16_of(crc16_of(crc, (uint8_t)(data_id & 0xFFu)), (uint8_t)(data_id >> 8));
}

#endif

uint8_t resonarm_e2e_counter_after(uint8_t counter, uint8_t counter_max)
{
    return counter >= counter_max ? 0 : (uint8_t)(counter + 1);
}

resonarm_verdict resonarm_e2e_supervise(
    resonarm_supervision *supervision, uint8_t counter, uint8_t counter_max, uint8_t *lost)
{
    *lost = 0;
    if (counter > counter_max) {
        return RESONARM_INVALID_COUNTER;
    }
    const bool first = !supervision->started;
    const unsigned modulus = counter_max + 1u;
    const unsigned delta = (counter + modulus - supervision->last) % modulus;
    supervision->started = true;
    supervision->last = counter;
    if (first) {
        return RESONARM_ACCEPTED;
    }
    if (delta == 0) {
        return RESONARM_REPEATED;
    }
    if (delta > RESONARM_MAX_DELTA_COUNTER) {
        return RESONARM_WRONG_SEQUENCE;
    }
    *lost = (uint8_t)(delta - 1);
    return RESONARM_ACCEPTED;
}
