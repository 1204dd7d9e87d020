/**
 * @file resonarm_exciter.h
 * @brief The node of an exciter (SPEC.md, sections 5 to 9): arms the plant, answers its samples, disarms it.
 *
 * A state machine without input and output. Frames and the time go in, frames come out:
 *
 *     resonarm_exciter_handle_frame(now, frame) --+             +-- next_frame(), frame_sent()
 *     resonarm_exciter_handle_deadline(now) ------+--> node ----+-- next_deadline_ns(): when to call again
 *                                                               +-- the function that answers a sample
 *
 * Times are nanoseconds of any clock that only goes forward. Before handle_deadline() hand over all frames that wait:
 * the timeouts count the time in which the node listened (section 6). A frame is made when it is fetched: fetch it
 * anew after any other call.
 */
#ifndef RESONARM_EXCITER_H
#define RESONARM_EXCITER_H

#include "resonarm.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Time between two attempts to arm or disarm the plant, ns (section 7). */
#define RESONARM_RETRY_NS UINT64_C(100000000)
/** Emergencies, heartbeats, hellos, capabilities and requests that can wait; none waits twice in a row. */
#define RESONARM_OUTBOX_MESSAGES 32

/** The node's timeouts. */
typedef struct {
    uint64_t command_timeout_ns; /**< Longest time, listened, in which frames wait and none can be sent. */
    uint64_t partner_timeout_ns; /**< Longest time, listened, without a whole sample or the plant's heartbeat. */
    uint64_t look_period_ns;     /**< The most that counts as listened between two calls. */
} resonarm_timing;

/** The times of section 6 in real time, at a rate of at least RESONARM_REAL_TIME_RATE_MIN_HZ. */
resonarm_timing resonarm_real_time(uint16_t rate_hz);
/** The times of section 6 in lockstep. */
resonarm_timing resonarm_lockstep(void);

/** A whole sample (section 8). */
typedef struct {
    uint64_t sample; /**< Counted from the first one answered, including lost ones. */
    resonarm_impedance_head head;
    resonarm_acceleration b;
    resonarm_acceleration c;
} resonarm_sample;

/** The answer's action. */
typedef enum {
    RESONARM_HOLD_FORCE,  /**< Command `force_x_n` and `force_y_n`. */
    RESONARM_HOLD_TORQUE, /**< Command `torque1_nm` and `torque2_nm`. */
    RESONARM_FINISH,      /**< The work is done: disarm. */
    RESONARM_GIVE_UP      /**< The work is impossible: disarm. */
} resonarm_action;

/** The answer to a sample: a load to hold until the next, or the end. */
typedef struct {
    resonarm_action action;
    double force_x_n;  /**< ±655.34 N, FD the range of a single; beyond, the node faults (command out of range). */
    double force_y_n;  /**< Like `force_x_n`. */
    double torque1_nm; /**< ±1638.35 N·m, FD the range of a single; beyond, like `force_x_n`. */
    double torque2_nm; /**< Like `torque1_nm`. */
} resonarm_answer;

/** Answers a whole sample, without delay: the plant waits. */
typedef resonarm_answer (*resonarm_answer_function)(void *context, const resonarm_sample *sample);

/** How the work ended. */
typedef enum {
    RESONARM_NOT_ENDED,
    RESONARM_FINISHED,   /**< The answer was RESONARM_FINISH, and the plant is disarmed. */
    RESONARM_GAVE_UP,    /**< The answer was RESONARM_GIVE_UP, and the plant is disarmed. */
    RESONARM_STOPPED,    /**< It was stopped, or the plant disarmed by another. */
    RESONARM_PLANT_LEFT, /**< The plant left the bus. */
    RESONARM_FAULTED     /**< A fault of this node's or the plant's. */
} resonarm_outcome;

/** The node's report. */
typedef struct {
    resonarm_state state;
    resonarm_outcome outcome;
    resonarm_node fault_node;    /**< The node whose fault ended it, if one did. */
    resonarm_emergency fault;    /**< The fault, if one ended it (section 9). */
    bool has_heard_plant;        /**< Whether a plant has been heard. */
    uint64_t samples_answered;   /**< Samples from the first to the last answered, including lost ones. */
    uint64_t missed_samples;     /**< Samples that were never complete. */
    uint32_t stale_samples;      /**< Samples ignored because of their index. */
    uint64_t slipped_periods;    /**< Sample periods by which the plant said its schedule has moved. */
    uint32_t refused_frames;     /**< Frames of the protocol that failed a check (section 2). */
    /** Those of them with identifiers that only this node sends: another network has the same base (section 1). */
    uint32_t other_sender_frames;
    /** The plant's fault, reported after this node had missed its samples and faulted; code 0 if there was none. */
    resonarm_emergency plant_fault;
    uint32_t unsent_frames;      /**< Frames that newer ones replaced. */
} resonarm_report;

/** @cond the members of resonarm_exciter */
/* Bytes in the longest message of an exciter. */
#ifdef RESONARM_CLASSIC_ONLY
#define RESONARM_EXCITER_BYTES_ 8
#else
#define RESONARM_EXCITER_BYTES_ 16
#endif

typedef struct {
    uint64_t look_period_ns;
    uint64_t looked_at_ns;
    uint64_t listened_ns;
} resonarm_listening_;

/* A message that waits, without counter and CRC. */
typedef struct {
    resonarm_kind kind;
    uint8_t content[RESONARM_EXCITER_BYTES_];
} resonarm_waiting_;

typedef struct {
    resonarm_waiting_ control[RESONARM_OUTBOX_MESSAGES];
    size_t first;
    size_t count;
    bool has_command;
    resonarm_waiting_ command;
    uint32_t unsent;
} resonarm_outbox_;

typedef struct {
    resonarm_transmitter transmitter;
    resonarm_receiver receiver;
    resonarm_outbox_ outbox;
    resonarm_listening_ listening;
    resonarm_timing timing;
    resonarm_hello hello;
    resonarm_capabilities capabilities;
    resonarm_state state;
    uint64_t heartbeat_at_ns;
    uint64_t hello_at_ns;
    uint64_t partner_heard_ns;
    bool is_waiting;
    uint64_t waiting_since_ns;
    uint32_t refused_frames;
    uint32_t other_sender_frames;
    uint16_t second_sender; /* Identifier of a message received that only this node sends; 0 if there was none. */
} resonarm_link_;

typedef struct {
    uint16_t window;
    bool started;
    uint16_t last;
    uint32_t stale;
} resonarm_sequence_;

typedef enum { RESONARM_ARMING_, RESONARM_PLAYING_, RESONARM_DISARMING_, RESONARM_DONE_ } resonarm_phase_;
typedef enum { RESONARM_STAY_, RESONARM_LEAVE_ASKED_, RESONARM_LEAVE_TOLD_ } resonarm_leave_;
/** @endcond */

/** The node. Its members are private: use the functions. */
typedef struct {
    resonarm_link_ link;
    resonarm_answer_function answer;
    void *context;
    resonarm_phase_ phase;
    resonarm_outcome outcome; /* In RESONARM_DISARMING_ and RESONARM_DONE_. */
    resonarm_leave_ leave;
    resonarm_node fault_node;
    resonarm_emergency fault;
    resonarm_emergency plant_fault;
    bool has_plant_hello;
    bool has_plant_state;
    resonarm_state plant_state;
    uint64_t retry_at_ns;
    uint64_t sample_heard_ns;
    bool has_head;
    bool has_b;
    resonarm_impedance_head head;
    resonarm_acceleration b;
    resonarm_sequence_ sequence;
    uint64_t samples_answered;
    uint64_t missed_samples;
    uint64_t slipped_periods;
} resonarm_exciter;

/** The configuration of a node. */
typedef struct {
    resonarm_network network;
    uint16_t rate_hz; /**< Sample rate expected of the plant, 1 to 65535 Hz. */
    resonarm_timing timing;
    resonarm_answer_function answer;
    void *context; /**< First argument of `answer`. */
    /** FD: the node's capabilities. With two samples per frame `answer` is called for both, and its command
     * at the second is held for two sample periods. A command beyond the limits is not sent: the node faults with
     * RESONARM_COMMAND_OUT_OF_RANGE, as with a limit of 0 at any load. Without a number of samples per frame,
     * 1 or 2, it states 1; with a limit that can't be sent, negative or no number, it states nothing and commands
     * nothing. The classic profile has no capabilities, and no such check. */
    resonarm_capabilities capabilities;
} resonarm_exciter_config;

/** A node in the state boot-up. */
void resonarm_exciter_init(resonarm_exciter *exciter, const resonarm_exciter_config *config);
/** Boots: heartbeats and hello (section 7). It then looks for a plant and arms it. */
void resonarm_exciter_start(resonarm_exciter *exciter, uint64_t now_ns);
/** Takes a frame; one that is invalid or not of the protocol affects only the report. */
void resonarm_exciter_handle_frame(resonarm_exciter *exciter, uint64_t now_ns, const resonarm_frame *frame);
/** Does the work that is due: heartbeats, hellos, retries, timeouts. */
void resonarm_exciter_handle_deadline(resonarm_exciter *exciter, uint64_t now_ns);
/** The latest time for the next call of resonarm_exciter_handle_deadline(). */
uint64_t resonarm_exciter_next_deadline_ns(const resonarm_exciter *exciter);
/** The next frame to send, if there is one. */
bool resonarm_exciter_next_frame(const resonarm_exciter *exciter, resonarm_frame *frame);
/** The bus has taken the frame from resonarm_exciter_next_frame(). */
void resonarm_exciter_frame_sent(resonarm_exciter *exciter);
/** The CAN controller is bus off: a working node faults, another waits for the bus to come back (section 8). */
void resonarm_exciter_bus_lost(resonarm_exciter *exciter, uint64_t now_ns);
/** Ends the work now: disarms the plant, even if it was only asked to arm. */
void resonarm_exciter_stop(resonarm_exciter *exciter, uint64_t now_ns);
/** Leaves the bus: stops, then sends its leaving. It has left when resonarm_exciter_is_quiet(). */
void resonarm_exciter_leave(resonarm_exciter *exciter, uint64_t now_ns);
/** Starts over after a fault, by resetting itself; false if no fault ended the work, or the node leaves. */
bool resonarm_exciter_rearm(resonarm_exciter *exciter, uint64_t now_ns);
/** Whether the work has ended and all frames are sent. */
bool resonarm_exciter_is_quiet(const resonarm_exciter *exciter);
/** The node's report. */
resonarm_report resonarm_exciter_report(const resonarm_exciter *exciter);

#ifdef __cplusplus
}
#endif

#endif
