/**
 * @file resonarm.h
 * @brief The Resonarm protocol in both profiles: messages in SI units to CAN frames and back, with E2E protection.
 *
 * C99, no allocation, no static state: everything is in structures of the caller. "Section" means a section of
 * SPEC.md, which is the specification. The numbers of the protocol are in resonarm_config.h, with those of a network;
 * `resonarm protocol header` writes that file for any network.
 *
 * A double must be an IEEE 754 binary64 and a float a binary32, computed without excess precision, without -ffast-math,
 * and rounded to nearest.
 *
 * With RESONARM_CLASSIC_ONLY defined, the same for every file that includes this one, the library is built without the
 * FD profile: it makes no network of it, and frames have 8 bytes.
 */
#ifndef RESONARM_H
#define RESONARM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "resonarm_config.h"

/** @name Version of this library, equal to that of the crate resonarm-protocol. The protocol's version is separate:
 * RESONARM_PROTOCOL_VERSION. */
/**@{*/
#define RESONARM_VERSION_MAJOR 0
#define RESONARM_VERSION_MINOR 1
#define RESONARM_VERSION_PATCH 0
/** The same as text. */
#define RESONARM_VERSION "0.1.0"
/**@}*/

#ifdef __cplusplus
extern "C" {
#endif

/** A sample period, rounded down, ns; for a rate of 0 that of 1 Hz. */
uint64_t resonarm_sample_period_ns(uint16_t rate_hz);

/** How far the index of a sample may be from the last one answered, samples: the window w of section 8. */
uint16_t resonarm_sample_window(uint16_t rate_hz);

/** The frames of a network's commands and samples. */
typedef enum { RESONARM_PROFILE_CLASSIC = 0, RESONARM_PROFILE_FD = 1 } resonarm_profile;

/** The identifiers and the profile of a network; make one with resonarm_network_init(). */
typedef struct {
    uint16_t base;      /**< First identifier of the block. */
    uint8_t plant_id;   /**< Node id of the plant. */
    uint8_t exciter_id; /**< Node id of the exciter. */
    resonarm_profile profile;
} resonarm_network;

/** Whether a network is possible. */
typedef enum {
    RESONARM_NETWORK_VALID,
    RESONARM_BASE_OUT_OF_RANGE,    /**< The base is not in RESONARM_BASE_MIN to RESONARM_BASE_MAX. */
    RESONARM_BASE_UNALIGNED,       /**< The base is not a multiple of 0x10. */
    RESONARM_NODE_ID_OUT_OF_RANGE, /**< A node id is not in 1 to RESONARM_NODE_ID_MAX. */
    RESONARM_SAME_NODE_ID,         /**< Both nodes have the same node id. */
    RESONARM_PROFILE_NOT_BUILT     /**< The library is built without the FD profile. */
} resonarm_network_check;

/** Checks a base identifier and two node ids, by default 1 and 2, and makes the network of them if it is possible. */
resonarm_network_check resonarm_network_init(
    resonarm_network *network, uint16_t base, uint8_t plant_id, uint8_t exciter_id, resonarm_profile profile);

/** The network of resonarm_config.h. */
resonarm_network resonarm_own_network(void);

/** A node; the value is its number in messages, independent of its node id. */
typedef enum { RESONARM_PLANT = 1, RESONARM_EXCITER = 2 } resonarm_node;

/** The kinds of messages; each has its own identifier, sender, data id and counter (section 1). */
typedef enum {
    RESONARM_OPERATOR_COMMAND,
    RESONARM_FORCE_COMMAND,
    RESONARM_TORQUE_COMMAND,
    RESONARM_IMPEDANCE_HEAD,
    RESONARM_ACCELEROMETER_B,
    RESONARM_ACCELEROMETER_C,
    RESONARM_PLANT_HELLO,
    RESONARM_EXCITER_HELLO,
    RESONARM_PLANT_HEARTBEAT,
    RESONARM_EXCITER_HEARTBEAT,
    RESONARM_PLANT_EMERGENCY,
    RESONARM_EXCITER_EMERGENCY,
    RESONARM_SENSORS,             /**< FD profile only, like all after it. */
    RESONARM_SENSOR_PAIR,         /**< Like RESONARM_SENSORS. */
    RESONARM_PLANT_CAPABILITIES,  /**< Like RESONARM_SENSORS. */
    RESONARM_EXCITER_CAPABILITIES /**< Like RESONARM_SENSORS. */
} resonarm_kind;
/** How many kinds there are. */
#define RESONARM_KINDS 16

/** The node that sends messages of this kind. */
resonarm_node resonarm_sender(resonarm_kind kind);
/** The 11-bit identifier of messages of this kind. */
uint16_t resonarm_identifier(resonarm_network network, resonarm_kind kind);
/** The E2E data id of this kind; 0 for a heartbeat, which is not protected. */
uint16_t resonarm_data_id(resonarm_network network, resonarm_kind kind);
/** Bytes in a message of this kind; 0 if the profile has no such message. */
uint8_t resonarm_length(resonarm_profile profile, resonarm_kind kind);
/** The name of this kind in the DBC. */
const char *resonarm_name(resonarm_kind kind);

/** The format of an identifier (ISO 11898-1). */
typedef enum { RESONARM_ID_STANDARD, RESONARM_ID_EXTENDED } resonarm_id_format;
/** The format of a frame (ISO 11898-1). */
typedef enum { RESONARM_FRAME_CLASSIC, RESONARM_FRAME_REMOTE, RESONARM_FRAME_FD } resonarm_frame_format;
/** Most bytes in a frame. */
#ifdef RESONARM_CLASSIC_ONLY
#define RESONARM_FRAME_BYTES 8
#else
#define RESONARM_FRAME_BYTES 64
#endif

/** The format of the frames of this kind in a profile. */
resonarm_frame_format resonarm_format(resonarm_profile profile, resonarm_kind kind);

/** A CAN frame. CAN FD frames are sent with bit rate switch, and accepted with and without. */
typedef struct {
    uint32_t id; /**< 11 or 29 bits. */
    resonarm_id_format id_format;
    resonarm_frame_format format;
    uint8_t length; /**< Bytes in `data`: 0 to 8, in CAN FD to 64; more than RESONARM_FRAME_BYTES is rejected. */
    uint8_t data[RESONARM_FRAME_BYTES];
} resonarm_frame;

/** The state of a node, with the value of its heartbeat (section 5). */
typedef enum {
    RESONARM_BOOT_UP = 0,
    RESONARM_FAULT = 4,
    RESONARM_OPERATIONAL = 5,
    RESONARM_PRE_OPERATIONAL = 127
} resonarm_state;
/** An event that changes a node's state (section 5). */
typedef enum {
    RESONARM_EVENT_STARTED,
    RESONARM_EVENT_ARM,
    RESONARM_EVENT_DISARM,
    RESONARM_EVENT_RESET,
    RESONARM_EVENT_FAULT
} resonarm_event;

/** The state after an event; the same state if the event changes nothing (the table of section 5). */
resonarm_state resonarm_next_state(resonarm_state state, resonarm_event event);

/** The request of an OperatorCommand. */
typedef enum { RESONARM_ARM = 1, RESONARM_DISARM = 2, RESONARM_RESET = 3 } resonarm_request;
/** Codes of emergencies (section 9). */
typedef enum {
    RESONARM_COMMAND_TIMEOUT = 1,
    RESONARM_SENSOR_TIMEOUT = 2,
    RESONARM_HEARTBEAT_LOST = 3,
    RESONARM_PARTNER_FAULT = 4,
    RESONARM_INCOMPATIBLE = 5,
    RESONARM_COMMAND_OUT_OF_RANGE = 6,
    RESONARM_SIMULATION_FAILED = 7,
    RESONARM_OVERRUN = 8,
    RESONARM_BUS_LOSS = 9,
    RESONARM_SAMPLE_SEQUENCE = 10,
    RESONARM_SCHEDULE_SLIPPED = 11,
    RESONARM_LEAVING = 12,
    RESONARM_SECOND_SENDER = 13,
    RESONARM_EXCITER_TRIPPED = 14
} resonarm_code;
/** Details of RESONARM_INCOMPATIBLE (section 9), and one for two nodes that fit. */
typedef enum {
    RESONARM_NO_HELLO = 0,
    RESONARM_OTHER_VERSION = 1,
    RESONARM_OTHER_DBC = 2,
    RESONARM_OTHER_PROFILE = 3,
    RESONARM_OTHER_RATE = 4,
    RESONARM_FITS = 0xFFFF
} resonarm_mismatch;

/** OperatorCommand. */
typedef struct {
    resonarm_request request;
    resonarm_node target;
} resonarm_operator_command;
/** ForceCommand: the force on point C, ±655.34 N in steps of 0.02 N; FD: a single. */
typedef struct {
    double force_x_n;
    double force_y_n;
    uint16_t sample; /**< Index of the sample answered, modulo 65536. */
} resonarm_force_command;
/** TorqueCommand: the torques at the joints, ±1638.35 N·m in steps of 0.05 N·m; FD: a single. */
typedef struct {
    double torque1_nm;
    double torque2_nm;
    uint16_t sample; /**< Index of the sample answered, modulo 65536. */
} resonarm_torque_command;
/** ImpedanceHead: the force at point C, ±655.34 N in steps of 0.02 N. A sender clips and flags values beyond. */
typedef struct {
    double force_x_n;
    double force_y_n;
    bool x_saturated;
    bool y_saturated;
    uint16_t sample; /**< Index of the sample, modulo 65536. */
} resonarm_impedance_head;
/** AccelerometerB, AccelerometerC: ±1638.35 m/s² in steps of 0.05 m/s². A sender clips and flags values beyond. */
typedef struct {
    double acceleration_x_m_s2;
    double acceleration_y_m_s2;
    bool x_saturated;
    bool y_saturated;
    uint16_t sample; /**< Index of the sample, modulo 65536. */
} resonarm_acceleration;
/** PlantHello, ExciterHello. */
typedef struct {
    uint8_t version_major; /**< 0 to 15. */
    uint8_t version_minor; /**< 0 to 15. */
    uint32_t dbc_hash;     /**< 24 bits. */
    resonarm_profile profile;
    uint16_t rate_hz; /**< Sample rate, 1 to 65535 Hz. */
} resonarm_hello;
/** PlantEmergency, ExciterEmergency (section 9). */
typedef struct {
    resonarm_code code;
    uint16_t detail; /**< Its meaning depends on the code. */
    uint16_t sample; /**< Index of the sample at which it was detected, modulo 65536. */
} resonarm_emergency;

/** The readings of a sample; the names are those of the DBC. */
typedef enum {
    RESONARM_FORCE_X_N,
    RESONARM_FORCE_Y_N,
    RESONARM_ACCELERATION_B_X_M_S2,
    RESONARM_ACCELERATION_B_Y_M_S2,
    RESONARM_ACCELERATION_C_X_M_S2,
    RESONARM_ACCELERATION_C_Y_M_S2
} resonarm_reading;
/** How many there are. */
#define RESONARM_READINGS 6

/** The readings at one sample, indexed by resonarm_reading. A sender clips and flags values
 * beyond the range of a single. */
typedef struct {
    double values[RESONARM_READINGS];
    bool saturated[RESONARM_READINGS];
} resonarm_readings;
/** Sensors. */
typedef struct {
    resonarm_readings readings;
    uint16_t sample; /**< Index of the sample, modulo 65536. */
} resonarm_sensors;
/** SensorPair: two samples in a row. */
typedef struct {
    resonarm_readings readings[2];
    uint16_t sample; /**< Index of the first, modulo 65536. */
} resonarm_sensor_pair;
/** PlantCapabilities, ExciterCapabilities: the limits of what a node accepts (plant) or commands (exciter). */
typedef struct {
    uint8_t samples_per_frame; /**< The most that the plant sends, or the exciter accepts: 1 or 2. */
    double force_limit_n;      /**< Largest force along one axis, from 0. */
    double torque_limit_nm;    /**< Largest torque at one joint, from 0. */
} resonarm_capabilities;

/** A message; `kind` selects the member of `content`. */
typedef struct {
    resonarm_kind kind;
    union {
        resonarm_operator_command operator_command;
        resonarm_force_command force;
        resonarm_torque_command torque;
        resonarm_impedance_head head;
        resonarm_acceleration acceleration; /**< Of both accelerometers. */
        resonarm_hello hello;               /**< Of both nodes. */
        resonarm_state state;               /**< Of both heartbeats. */
        resonarm_emergency emergency;       /**< Of both nodes. */
#ifndef RESONARM_CLASSIC_ONLY
        resonarm_sensors sensors;
        resonarm_sensor_pair pair;
        resonarm_capabilities capabilities; /**< Of both nodes. */
#endif
    } content;
} resonarm_message;

/** The hello of this code in a profile, at a sample rate in Hz. */
resonarm_hello resonarm_own_hello(resonarm_profile profile, uint16_t rate_hz);
/** Why a node with the hello `own` does not fit one with `partner` (section 5). */
resonarm_mismatch resonarm_compare_hellos(const resonarm_hello *own, const resonarm_hello *partner);

/** Whether a message can be sent. */
typedef enum {
    RESONARM_SENDABLE,
    RESONARM_NOT_FINITE,   /**< A value is not a number, or infinite. */
    RESONARM_OUT_OF_RANGE, /**< A commanded value rounds beyond the range of its signal; never clipped (section 3). */
    RESONARM_INVALID,      /**< A whole number is not one that the signal can have. */
    RESONARM_NEGATIVE,     /**< A limit is less than zero. */
    RESONARM_NOT_SENT      /**< The profile has no such message. */
} resonarm_encode_reason;

/** Why a message can't be sent. */
typedef struct {
    resonarm_encode_reason reason;
    /** Name of the signal as in the DBC, for a pair of samples without its prefix; NULL if none is at fault. */
    const char *signal;
    double got;         /**< The value, in the unit of the signal. */
    double min;         /**< The smallest value that can be sent; also set for a value that is not finite. */
    double max;         /**< The largest value that can be sent. */
} resonarm_encoding;

/** Makes the frames of one node: protects messages and keeps their counters (section 2). */
typedef struct {
    resonarm_network network;
    uint8_t counters[RESONARM_KINDS];
} resonarm_transmitter;

/** A transmitter whose counters start at 0. */
void resonarm_transmitter_init(resonarm_transmitter *transmitter, resonarm_network network);
/** The frame of a message with its next counter. If it is not sendable, `frame` is undefined. */
resonarm_encoding resonarm_encode(
    const resonarm_transmitter *transmitter, const resonarm_message *message, resonarm_frame *frame);
/** The bus has taken the frame of a message of this kind: its counter is used. */
void resonarm_frame_taken(resonarm_transmitter *transmitter, resonarm_kind kind);

/** A receiver's verdict on a frame; refusals in the order of its checks (section 2). */
typedef enum {
    RESONARM_ACCEPTED,
    RESONARM_IGNORED, /**< Not a frame of this protocol. */
    RESONARM_NOT_IN_PROFILE, /**< The profile has no such message. */
    RESONARM_BAD_FORMAT,
    RESONARM_BAD_LENGTH,
    RESONARM_BAD_CRC,
    RESONARM_REPEATED,        /**< The counter of the frame before. */
    RESONARM_WRONG_SEQUENCE,  /**< The counter steps by more than 4. */
    RESONARM_INVALID_COUNTER, /**< The counter is 15, classical frames. */
    RESONARM_RESERVED,        /**< A bit without a signal is set. */
    RESONARM_NOT_AVAILABLE,   /**< A physical signal has the count -32768. */
    RESONARM_VALUE_NOT_FINITE,/**< A single is not a finite number. */
    RESONARM_VALUE_NEGATIVE, /**< A limit is less than zero. */
    RESONARM_UNKNOWN_VALUE    /**< A signal has a value without a meaning. */
} resonarm_verdict;

/** A verdict with its values. */
typedef struct {
    resonarm_verdict verdict;
    resonarm_kind kind; /**< The message of the identifier; meaningless if ignored. */
    /** Name of the signal whose value is rejected, as in resonarm_encoding, or NULL. */
    const char *signal;
    /** Length, CRC, counter, reserved bits or value received. */
    uint16_t got;
    /** Length or CRC expected; the last counter (wrong sequence); the byte of the frame (reserved). */
    uint16_t expected;
} resonarm_receipt;

/** The counter supervision of one message (section 2). */
typedef struct {
    bool started; /**< Whether a counter has been seen. */
    uint8_t last; /**< The last one seen. */
} resonarm_supervision;

/** Receives the frames of a network and supervises their counters. */
typedef struct {
    resonarm_network network;
    resonarm_supervision supervisions[RESONARM_KINDS];
    uint64_t lost; /**< Frames lost according to the counters, except those whose loss broke the sequence. */
} resonarm_receiver;

/** A receiver that accepts the first counter of every message. */
void resonarm_receiver_init(resonarm_receiver *receiver, resonarm_network network);
/**
 * Checks a frame: format, length, CRC, counter, content. `message` is written only if it is accepted. A boot-up
 * heartbeat restarts the supervision of all messages of its node (section 2).
 */
resonarm_receipt resonarm_accept(resonarm_receiver *receiver, const resonarm_frame *frame, resonarm_message *message);

#ifdef __cplusplus
}
#endif

#endif
