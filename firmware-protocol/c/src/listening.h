/** @file listening.h
 * @brief The time that a node listened, the clock of its timeouts (section 6).
 *
 * Between two looks at the clock at most one look period counts: listened += min(now - last look, look period). */
#ifndef RESONARM_LISTENING_H
#define RESONARM_LISTENING_H

#include "resonarm_exciter.h"

/** The node looks: it has taken all frames received, and checks its deadlines. */
void resonarm_listening_look(resonarm_listening_ *listening, uint64_t now_ns);

/** Whether `timeout_ns` of listening have passed since `since_ns`, of the time listened. */
bool resonarm_listening_has_passed(const resonarm_listening_ *listening, uint64_t since_ns, uint64_t timeout_ns);

/** When to look next, on the clock, for a running timeout. */
uint64_t resonarm_listening_next_look_ns(const resonarm_listening_ *listening, uint64_t since_ns, uint64_t timeout_ns);

/** a + b, or the largest number if that is more. */
uint64_t resonarm_saturating_sum(uint64_t a, uint64_t b);

/** The lesser of two times. */
uint64_t resonarm_earlier(uint64_t a, uint64_t b);

#endif
