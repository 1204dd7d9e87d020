#include "resonarm_exciter.h"

#include "link.h"
#include "listening.h"
#include "outbox.h"
#include "readings.h"
#include "sequence.h"

resonarm_timing resonarm_real_time(uint16_t rate_hz)
{
    return (resonarm_timing){
        .command_timeout_ns = RESONARM_COMMAND_TIMEOUT_NS,
        .partner_timeout_ns = RESONARM_HEARTBEAT_TIMEOUT_NS,
        .look_period_ns = resonarm_sample_period_ns(rate_hz),
    };
}

resonarm_timing resonarm_lockstep(void)
{
    return (resonarm_timing){
        .command_timeout_ns = RESONARM_LOCKSTEP_TIMEOUT_NS,
        .partner_timeout_ns = RESONARM_LOCKSTEP_TIMEOUT_NS,
        .look_period_ns = RESONARM_LOCKSTEP_LOOK_NS,
    };
}

static void send_emergency(resonarm_exciter *exciter, resonarm_code code, uint16_t detail)
{
    resonarm_message message = {.kind = RESONARM_EXCITER_EMERGENCY};
    message.content.emergency = (resonarm_emergency){code, detail, exciter->sequence.last};
    (void)resonarm_link_send(&exciter->link, &message);
}

static void request(resonarm_exciter *exciter, resonarm_request what)
{
    resonarm_message message = {.kind = RESONARM_OPERATOR_COMMAND};
    message.content.operator_command = (resonarm_operator_command){what, RESONARM_PLANT};
    (void)resonarm_link_send(&exciter->link, &message);
}

static void end(resonarm_exciter *exciter, resonarm_outcome outcome)
{
    exciter->phase = RESONARM_DONE_;
    exciter->outcome = outcome;
}

static void end_by(resonarm_exciter *exciter, resonarm_node node, const resonarm_emergency *emergency)
{
    exciter->fault_node = node;
    exciter->fault = *emergency;
    end(exciter, RESONARM_FAULTED);
}

/* A fault detected by this node. A node whose work has ended detects none. */
static void fault(resonarm_exciter *exciter, uint64_t now_ns, resonarm_code code, uint16_t detail)
{
    if (exciter->phase == RESONARM_DONE_) {
        return;
    }
    const resonarm_emergency emergency = {code, detail, exciter->sequence.last};
    send_emergency(exciter, code, detail);
    resonarm_link_transition(&exciter->link, now_ns, RESONARM_EVENT_FAULT);
    end_by(exciter, RESONARM_EXCITER, &emergency);
}

static void disarm(resonarm_exciter *exciter, uint64_t now_ns, resonarm_outcome outcome)
{
    exciter->phase = RESONARM_DISARMING_;
    exciter->outcome = outcome;
    exciter->retry_at_ns = resonarm_saturating_sum(now_ns, RESONARM_RETRY_NS);
    request(exciter, RESONARM_DISARM);
    resonarm_link_transition(&exciter->link, now_ns, RESONARM_EVENT_DISARM);
}

/* The plant arms only after a hello that fits (section 5), and leaves a fault only by a reset. */
static void ask_for_arming(resonarm_exciter *exciter, uint64_t now_ns)
{
    exciter->retry_at_ns = resonarm_saturating_sum(now_ns, RESONARM_RETRY_NS);
    if (!exciter->has_plant_hello) {
        return;
    }
    resonarm_link_send_hello(&exciter->link, now_ns);
    if (exciter->has_plant_state && exciter->plant_state == RESONARM_FAULT) {
        request(exciter, RESONARM_RESET);
    }
    request(exciter, RESONARM_ARM);
}

static void take_hello(resonarm_exciter *exciter, uint64_t now_ns, const resonarm_hello *hello)
{
    const resonarm_mismatch mismatch = resonarm_compare_hellos(&exciter->link.hello, hello);
    const bool is_new = !exciter->has_plant_hello;
    exciter->has_plant_hello = mismatch == RESONARM_FITS;
    if (mismatch != RESONARM_FITS) {
        fault(exciter, now_ns, RESONARM_INCOMPATIBLE, (uint16_t)mismatch);
        return;
    }
    if (is_new && exciter->phase == RESONARM_ARMING_) {
        ask_for_arming(exciter, now_ns);
    } else if (is_new) {
        resonarm_link_send_hello(&exciter->link, now_ns);
    }
}

static void watch_playing(resonarm_exciter *exciter, uint64_t now_ns, resonarm_state state)
{
    if (state == RESONARM_BOOT_UP || state == RESONARM_FAULT) {
        fault(exciter, now_ns, RESONARM_PARTNER_FAULT, RESONARM_PLANT);
    } else if (state == RESONARM_PRE_OPERATIONAL) {
        disarm(exciter, now_ns, RESONARM_STOPPED);
    }
}

/* The plant's heartbeat. */
static void watch(resonarm_exciter *exciter, uint64_t now_ns, resonarm_state state)
{
    exciter->has_plant_state = true;
    exciter->plant_state = state;
    if (state == RESONARM_BOOT_UP) {
        exciter->has_plant_hello = false;
    }
    switch (exciter->phase) {
    case RESONARM_ARMING_:
        if (state == RESONARM_OPERATIONAL && exciter->has_plant_hello) {
            exciter->phase = RESONARM_PLAYING_;
            exciter->sample_heard_ns = exciter->link.listening.listened_ns;
            resonarm_link_transition(&exciter->link, now_ns, RESONARM_EVENT_ARM);
        }
        break;
    case RESONARM_PLAYING_:
        watch_playing(exciter, now_ns, state);
        break;
    case RESONARM_DISARMING_:
        if (state == RESONARM_PRE_OPERATIONAL || state == RESONARM_FAULT) {
            end(exciter, exciter->outcome);
        }
        break;
    case RESONARM_DONE_:
        break;
    }
}

/* The plant leaves the bus; a node that is not armed yet waits for another plant. */
static void take_leaving(resonarm_exciter *exciter, uint64_t now_ns)
{
    exciter->has_plant_hello = false;
    exciter->has_plant_state = false;
    if (exciter->phase == RESONARM_PLAYING_) {
        end(exciter, RESONARM_PLANT_LEFT);
        resonarm_link_transition(&exciter->link, now_ns, RESONARM_EVENT_DISARM);
    } else if (exciter->phase == RESONARM_DISARMING_) {
        end(exciter, exciter->outcome);
    }
}

/* Whether this node faulted for lack of samples, so that the plant may report why none came. */
static bool has_missed_samples(const resonarm_exciter *exciter)
{
    return exciter->phase == RESONARM_DONE_ && exciter->outcome == RESONARM_FAULTED &&
           exciter->fault_node == RESONARM_EXCITER && exciter->fault.code == RESONARM_SENSOR_TIMEOUT;
}

/* The plant's fault ends the work. If it has no hello of this node yet, the next attempt fixes that. */
static void heed_fault(resonarm_exciter *exciter, uint64_t now_ns, const resonarm_emergency *emergency)
{
    const bool is_incompatible = emergency->code == RESONARM_INCOMPATIBLE;
    if (is_incompatible && emergency->detail == RESONARM_NO_HELLO) {
        return;
    }
    const bool is_arming = exciter->phase == RESONARM_ARMING_;
    if (exciter->phase == RESONARM_PLAYING_ || (is_arming && is_incompatible)) {
        resonarm_link_transition(&exciter->link, now_ns, RESONARM_EVENT_FAULT);
        end_by(exciter, RESONARM_PLANT, emergency);
    } else if (has_missed_samples(exciter) && emergency->code != RESONARM_PARTNER_FAULT) {
        exciter->plant_fault = *emergency;
    }
}

static void heed(resonarm_exciter *exciter, uint64_t now_ns, const resonarm_emergency *emergency)
{
    if (emergency->code == RESONARM_SCHEDULE_SLIPPED) {
        exciter->slipped_periods += emergency->detail;
    } else if (emergency->code == RESONARM_LEAVING) {
        take_leaving(exciter, now_ns);
    } else {
        heed_fault(exciter, now_ns, emergency);
    }
}

static void command(resonarm_exciter *exciter, uint64_t now_ns, const resonarm_answer *answer, uint16_t index)
{
    resonarm_message message;
    if (answer->action == RESONARM_HOLD_TORQUE) {
        message.kind = RESONARM_TORQUE_COMMAND;
        message.content.torque = (resonarm_torque_command){answer->torque1_nm, answer->torque2_nm, index};
    } else {
        message.kind = RESONARM_FORCE_COMMAND;
        message.content.force = (resonarm_force_command){answer->force_x_n, answer->force_y_n, index};
    }
    if (!resonarm_link_is_stated(&exciter->link, &message) || !resonarm_link_send(&exciter->link, &message)) {
        fault(exciter, now_ns, RESONARM_COMMAND_OUT_OF_RANGE, 0);
    }
}

/* Whether the sample of this index is a new one. */
static bool is_fresh(resonarm_exciter *exciter, uint64_t now_ns, uint16_t index)
{
    uint16_t ahead;
    switch (resonarm_sequence_judge(&exciter->sequence, index, &ahead)) {
    case SEQUENCE_STALE:
        return false;
    case SEQUENCE_BROKEN:
        fault(exciter, now_ns, RESONARM_SAMPLE_SEQUENCE, index);
        return false;
    case SEQUENCE_FIRST:
        exciter->samples_answered = 1;
        break;
    case SEQUENCE_AHEAD:
        exciter->samples_answered += ahead;
        exciter->missed_samples += ahead - 1u;
        break;
    }
    exciter->sample_heard_ns = exciter->link.listening.listened_ns;
    return true;
}

/* The answer to a whole sample of this index; false if nothing is to be commanded. */
static bool answer(
    resonarm_exciter *exciter, uint64_t now_ns, resonarm_sample *sample, uint16_t index, resonarm_answer *given)
{
    if (exciter->phase == RESONARM_DISARMING_) {
        /* The plant still sends samples, in lockstep for lack of an answer: the request may have been lost. */
        request(exciter, RESONARM_DISARM);
    }
    if (exciter->phase != RESONARM_PLAYING_ || !is_fresh(exciter, now_ns, index)) {
        return false;
    }
    sample->sample = exciter->samples_answered - 1;
    *given = exciter->answer(exciter->context, sample);
    if (given->action == RESONARM_FINISH) {
        disarm(exciter, now_ns, RESONARM_FINISHED);
    } else if (given->action == RESONARM_GIVE_UP) {
        disarm(exciter, now_ns, RESONARM_GAVE_UP);
    }
    return exciter->phase == RESONARM_PLAYING_;
}

/* In the classic profile a sample is complete with its last frame, accelerometer C. */
static void complete_sample(resonarm_exciter *exciter, uint64_t now_ns, const resonarm_acceleration *c)
{
    resonarm_answer given;
    const bool is_whole = exciter->has_head && exciter->head.sample == c->sample && exciter->has_b &&
                          exciter->b.sample == c->sample;
    resonarm_sample sample = {.head = exciter->head, .b = exciter->b, .c = *c};
    exciter->has_head = false;
    exciter->has_b = false;
    if (is_whole && answer(exciter, now_ns, &sample, c->sample, &given)) {
        command(exciter, now_ns, &given, c->sample);
    }
}

#ifndef RESONARM_CLASSIC_ONLY
/* In the FD profile a frame has one or two whole samples, the first of this index. The last of them is answered: a
 * command for the first of two would be too late. */
static void take_samples(
    resonarm_exciter *exciter, uint64_t now_ns, const resonarm_readings *readings, size_t count, uint16_t first)
{
    for (size_t i = 0; i < count; i++) {
        resonarm_answer given;
        const uint16_t index = (uint16_t)(first + i);
        resonarm_sample sample = resonarm_readings_sample(&readings[i], index);
        if (answer(exciter, now_ns, &sample, index, &given) && i + 1 == count) {
            command(exciter, now_ns, &given, index);
        }
    }
}
#endif

static void send_leaving(resonarm_exciter *exciter)
{
    if (exciter->leave == RESONARM_LEAVE_ASKED_ && exciter->phase == RESONARM_DONE_) {
        exciter->leave = RESONARM_LEAVE_TOLD_;
        send_emergency(exciter, RESONARM_LEAVING, 0);
    }
}

void resonarm_exciter_init(resonarm_exciter *exciter, const resonarm_exciter_config *config)
{
    *exciter = (resonarm_exciter){.answer = config->answer, .context = config->context};
    exciter->sequence = resonarm_sequence_new(config->rate_hz);
    resonarm_link_init(&exciter->link, config);
}

void resonarm_exciter_start(resonarm_exciter *exciter, uint64_t now_ns)
{
    resonarm_link_start(&exciter->link, now_ns);
    exciter->retry_at_ns = now_ns;
}

void resonarm_exciter_handle_frame(resonarm_exciter *exciter, uint64_t now_ns, const resonarm_frame *frame)
{
    resonarm_message message;
    if (!resonarm_link_accept(&exciter->link, now_ns, frame, &message)) {
        if (exciter->link.second_sender != 0) {
            fault(exciter, now_ns, RESONARM_SECOND_SENDER, exciter->link.second_sender);
            exciter->link.second_sender = 0;
        }
        return;
    }
    switch (message.kind) {
    case RESONARM_PLANT_HELLO:
        take_hello(exciter, now_ns, &message.content.hello);
        break;
    case RESONARM_PLANT_HEARTBEAT:
        watch(exciter, now_ns, message.content.state);
        break;
    case RESONARM_PLANT_EMERGENCY:
        heed(exciter, now_ns, &message.content.emergency);
        break;
    case RESONARM_IMPEDANCE_HEAD:
        exciter->has_head = true;
        exciter->head = message.content.head;
        break;
    case RESONARM_ACCELEROMETER_B:
        exciter->has_b = true;
        exciter->b = message.content.acceleration;
        break;
    case RESONARM_ACCELEROMETER_C:
        complete_sample(exciter, now_ns, &message.content.acceleration);
        break;
#ifndef RESONARM_CLASSIC_ONLY
    case RESONARM_SENSORS:
        take_samples(exciter, now_ns, &message.content.sensors.readings, 1, message.content.sensors.sample);
        break;
    case RESONARM_SENSOR_PAIR:
        take_samples(exciter, now_ns, message.content.pair.readings, 2, message.content.pair.sample);
        break;
#endif
    default:
        break;
    }
    send_leaving(exciter);
}

static bool is_sensor_lost(const resonarm_exciter *exciter)
{
    const resonarm_link_ *link = &exciter->link;
    return resonarm_listening_has_passed(&link->listening, exciter->sample_heard_ns, link->timing.partner_timeout_ns);
}

void resonarm_exciter_handle_deadline(resonarm_exciter *exciter, uint64_t now_ns)
{
    resonarm_link_ *link = &exciter->link;
    resonarm_link_handle_deadline(link, now_ns);
    const bool is_retry_due = now_ns >= exciter->retry_at_ns;
    if (exciter->phase == RESONARM_ARMING_ && is_retry_due) {
        ask_for_arming(exciter, now_ns);
    } else if (exciter->phase == RESONARM_DISARMING_ && resonarm_link_is_partner_lost(link)) {
        fault(exciter, now_ns, RESONARM_HEARTBEAT_LOST, RESONARM_PLANT);
    } else if (exciter->phase == RESONARM_DISARMING_ && is_retry_due) {
        disarm(exciter, now_ns, exciter->outcome);
    } else if (exciter->phase == RESONARM_PLAYING_ && resonarm_link_is_jammed(link)) {
        fault(exciter, now_ns, RESONARM_BUS_LOSS, resonarm_link_not_sent(link));
    } else if (exciter->phase == RESONARM_PLAYING_ && is_sensor_lost(exciter)) {
        fault(exciter, now_ns, RESONARM_SENSOR_TIMEOUT, exciter->sequence.last);
    }
    send_leaving(exciter);
}

uint64_t resonarm_exciter_next_deadline_ns(const resonarm_exciter *exciter)
{
    const resonarm_link_ *link = &exciter->link;
    const uint64_t due_ns = resonarm_earlier(link->heartbeat_at_ns, link->hello_at_ns);
    const uint64_t timeout_ns = link->timing.partner_timeout_ns;
    uint64_t look_ns;
    switch (exciter->phase) {
    case RESONARM_ARMING_:
        return resonarm_earlier(due_ns, exciter->retry_at_ns);
    case RESONARM_PLAYING_:
        look_ns = resonarm_listening_next_look_ns(&link->listening, exciter->sample_heard_ns, timeout_ns);
        return resonarm_earlier(due_ns, look_ns);
    case RESONARM_DISARMING_:
        look_ns = resonarm_listening_next_look_ns(&link->listening, link->partner_heard_ns, timeout_ns);
        return resonarm_earlier(resonarm_earlier(due_ns, look_ns), exciter->retry_at_ns);
    case RESONARM_DONE_:
        break;
    }
    return due_ns;
}

bool resonarm_exciter_next_frame(const resonarm_exciter *exciter, resonarm_frame *frame)
{
    return resonarm_link_next_frame(&exciter->link, frame);
}

void resonarm_exciter_frame_sent(resonarm_exciter *exciter)
{
    resonarm_link_frame_sent(&exciter->link);
}

void resonarm_exciter_bus_lost(resonarm_exciter *exciter, uint64_t now_ns)
{
    if (exciter->phase == RESONARM_PLAYING_) {
        fault(exciter, now_ns, RESONARM_BUS_LOSS, resonarm_link_not_sent(&exciter->link));
    }
}

void resonarm_exciter_stop(resonarm_exciter *exciter, uint64_t now_ns)
{
    /* A plant that has sent its hello was asked to arm, and may be armed before it reports that. */
    const bool is_asked = exciter->phase == RESONARM_ARMING_ && exciter->has_plant_hello;
    if (exciter->phase == RESONARM_PLAYING_ || is_asked) {
        disarm(exciter, now_ns, RESONARM_STOPPED);
    } else if (exciter->phase == RESONARM_ARMING_) {
        end(exciter, RESONARM_STOPPED);
    }
}

void resonarm_exciter_leave(resonarm_exciter *exciter, uint64_t now_ns)
{
    if (exciter->leave == RESONARM_STAY_) {
        exciter->leave = RESONARM_LEAVE_ASKED_;
        resonarm_exciter_stop(exciter, now_ns);
        send_leaving(exciter);
    }
}

bool resonarm_exciter_rearm(resonarm_exciter *exciter, uint64_t now_ns)
{
    const bool has_faulted = exciter->phase == RESONARM_DONE_ && exciter->outcome == RESONARM_FAULTED;
    if (!has_faulted || exciter->leave != RESONARM_STAY_) {
        return false;
    }
    resonarm_link_transition(&exciter->link, now_ns, RESONARM_EVENT_RESET);
    exciter->phase = RESONARM_ARMING_;
    /* By then it knows the plant's state after the fault. */
    exciter->retry_at_ns = resonarm_saturating_sum(now_ns, RESONARM_RETRY_NS);
    exciter->has_head = false;
    exciter->has_b = false;
    exciter->samples_answered = 0;
    exciter->plant_fault = (resonarm_emergency){.code = (resonarm_code)0};
    exciter->sequence = resonarm_sequence_new(exciter->link.hello.rate_hz);
    return true;
}

bool resonarm_exciter_is_quiet(const resonarm_exciter *exciter)
{
    return exciter->phase == RESONARM_DONE_ && resonarm_outbox_waiting(&exciter->link.outbox) == 0;
}

resonarm_report resonarm_exciter_report(const resonarm_exciter *exciter)
{
    return (resonarm_report){
        .state = exciter->link.state,
        .outcome = exciter->phase == RESONARM_DONE_ ? exciter->outcome : RESONARM_NOT_ENDED,
        .fault_node = exciter->fault_node,
        .fault = exciter->fault,
        .has_heard_plant = exciter->has_plant_state || exciter->has_plant_hello,
        .samples_answered = exciter->samples_answered,
        .missed_samples = exciter->missed_samples,
        .stale_samples = exciter->sequence.stale,
        .slipped_periods = exciter->slipped_periods,
        .refused_frames = exciter->link.refused_frames,
        .other_sender_frames = exciter->link.other_sender_frames,
        .plant_fault = exciter->plant_fault,
        .unsent_frames = exciter->link.outbox.unsent,
    };
}
