#include "loop.h"

#include "port.h"

/* Longest wait between two checks of the signal to end, ns. */
#define LOOK_NS UINT64_C(20000000)
/* How long to wait before a full transmit queue is tried again, ns. */
#define RETRY_NS UINT64_C(200000)
/* How long to keep sending the remaining frames at the end, ns. */
#define SEND_LIMIT_NS UINT64_C(500000000)

/* Sends the waiting frames, until the queue is full. */
static port_result transmit(resonarm_exciter *exciter)
{
    resonarm_frame frame;
    while (resonarm_exciter_next_frame(exciter, &frame)) {
        const port_result result = port_send(&frame);
        if (result != PORT_DONE) {
            return result;
        }
        resonarm_exciter_frame_sent(exciter);
    }
    return PORT_DONE;
}

/* Takes all waiting frames. The answer to a sample does not wait for the frames after it. */
static port_result take_in(resonarm_exciter *exciter, uint64_t now_ns)
{
    resonarm_frame frame;
    port_result received = port_receive(&frame);
    while (received == PORT_DONE) {
        resonarm_exciter_handle_frame(exciter, now_ns, &frame);
        const port_result sent = transmit(exciter);
        if (sent == PORT_BUS_OFF || sent == PORT_FAILED) {
            return sent;
        }
        received = port_receive(&frame);
    }
    return received;
}

/* Disarms a plant that was asked to arm, waits for its answer, and sends the leaving and the remaining frames. */
static void leave(resonarm_exciter *exciter)
{
    const uint64_t end_ns = port_now_ns() + SEND_LIMIT_NS;
    resonarm_exciter_leave(exciter, port_now_ns());
    while (port_now_ns() < end_ns) {
        const port_result received = take_in(exciter, port_now_ns());
        const port_result result = received == PORT_EMPTY ? transmit(exciter) : received;
        if (result == PORT_BUS_OFF || result == PORT_FAILED || resonarm_exciter_is_quiet(exciter)) {
            return;
        }
        port_wait(port_now_ns() + RETRY_NS);
    }
}

static bool is_armed_too_late(const resonarm_report *report, uint64_t waited_ns, uint64_t patience_ns)
{
    return report->state == RESONARM_PRE_OPERATIONAL && report->samples_answered == 0 && waited_ns > patience_ns;
}

loop_end loop_run(resonarm_exciter *exciter, uint64_t patience_ns)
{
    const uint64_t start_ns = port_now_ns();
    resonarm_exciter_start(exciter, start_ns);
    for (;;) {
        const uint64_t now_ns = port_now_ns();
        port_result result = take_in(exciter, now_ns);
        if (port_is_stopped()) {
            resonarm_exciter_leave(exciter, now_ns);
        }
        if (result == PORT_EMPTY) {
            resonarm_exciter_handle_deadline(exciter, now_ns);
            result = transmit(exciter);
        }
        if (result == PORT_BUS_OFF) {
            resonarm_exciter_bus_lost(exciter, now_ns);
        }
        const resonarm_report report = resonarm_exciter_report(exciter);
        if (result == PORT_FAILED) {
            return LOOP_NO_BUS;
        }
        if (report.outcome != RESONARM_NOT_ENDED || is_armed_too_late(&report, now_ns - start_ns, patience_ns)) {
            leave(exciter);
            return report.outcome == RESONARM_NOT_ENDED ? LOOP_NO_PLANT : LOOP_ENDED;
        }
        const uint64_t due_ns = resonarm_exciter_next_deadline_ns(exciter);
        const uint64_t longest_ns = now_ns + (result == PORT_DONE ? LOOK_NS : RETRY_NS);
        port_wait(due_ns < longest_ns ? due_ns : longest_ns);
    }
}
