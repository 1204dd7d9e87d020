/**
 * @file resonarm_config.h
 * @brief The numbers of the Resonarm protocol, and of the network with base 0x200, plant 1, exciter 2, classic.
 *
 * Written by `resonarm protocol header`, which writes that of another network, too. */
#ifndef RESONARM_CONFIG_H
#define RESONARM_CONFIG_H

#include <stdint.h>

/** @name Protocol */
/**@{*/
/** Version: major in the high nibble, minor in the low one (section 4, hello). */
#define RESONARM_PROTOCOL_VERSION 0x12u
/** Low 24 bits of the CRC-32 of resonarm.dbc, as a hello of the classic profile carries them. */
#define RESONARM_DBC_HASH_CLASSIC 0x066600u
/** The same of resonarm-fd.dbc, for the FD profile. */
#define RESONARM_DBC_HASH_FD 0x6AD351u
/** The classic profile's counts (section 3). */
#define RESONARM_COUNT_MAX 32767
#define RESONARM_COUNTS_PER_N 50
#define RESONARM_COUNTS_PER_NM 20
#define RESONARM_COUNTS_PER_M_S2 20
/** Largest step of an E2E counter that a receiver takes (section 2). */
#define RESONARM_MAX_DELTA_COUNTER 4u
/** Possible networks (section 1). */
#define RESONARM_BASE_MIN 0x180u
#define RESONARM_BASE_MAX 0x570u
#define RESONARM_NODE_ID_MAX 127u
/**@}*/

/** @name Times of section 6, ns, and limits of section 8 */
/**@{*/
#define RESONARM_HEARTBEAT_PERIOD_NS UINT64_C(100000000)
#define RESONARM_HEARTBEAT_TIMEOUT_NS UINT64_C(350000000)
#define RESONARM_HELLO_PERIOD_NS UINT64_C(1000000000)
#define RESONARM_COMMAND_TIMEOUT_NS UINT64_C(20000000)
#define RESONARM_COMMAND_AGE_NS UINT64_C(20000000)
#define RESONARM_FORCE_RAMP_NS UINT64_C(50000000)
#define RESONARM_LOCKSTEP_TIMEOUT_NS UINT64_C(1000000000)
#define RESONARM_LOCKSTEP_LOOK_NS UINT64_C(20000000)
/** Lowest sample rate in real time, Hz. */
#define RESONARM_REAL_TIME_RATE_MIN_HZ 100u
/** How many samples of a repeated or older index make a fault, counted from arming. */
#define RESONARM_STALE_SAMPLES_LIMIT 10u
/** Smallest window of the sample index, samples. */
#define RESONARM_SAMPLE_WINDOW_MIN 16u
/**@}*/

/** @name This network */
/**@{*/
#define RESONARM_BASE 0x200u
#define RESONARM_PLANT_ID 1u
#define RESONARM_EXCITER_ID 2u
#define RESONARM_PROFILE RESONARM_PROFILE_CLASSIC
/**@}*/

/** @name Messages of this network
 * Identifier, E2E data id (0: not protected), and bytes (0: not in this profile). */
/**@{*/
#define RESONARM_OPERATOR_COMMAND_ID 0x200u
#define RESONARM_OPERATOR_COMMAND_DATA_ID 0x5201u
#define RESONARM_OPERATOR_COMMAND_BYTES 8u
#define RESONARM_FORCE_COMMAND_ID 0x201u
#define RESONARM_FORCE_COMMAND_DATA_ID 0x5202u
#define RESONARM_FORCE_COMMAND_BYTES 8u
#define RESONARM_TORQUE_COMMAND_ID 0x202u
#define RESONARM_TORQUE_COMMAND_DATA_ID 0x5203u
#define RESONARM_TORQUE_COMMAND_BYTES 8u
#define RESONARM_IMPEDANCE_HEAD_ID 0x203u
#define RESONARM_IMPEDANCE_HEAD_DATA_ID 0x5204u
#define RESONARM_IMPEDANCE_HEAD_BYTES 8u
#define RESONARM_ACCELEROMETER_B_ID 0x204u
#define RESONARM_ACCELEROMETER_B_DATA_ID 0x5205u
#define RESONARM_ACCELEROMETER_B_BYTES 8u
#define RESONARM_ACCELEROMETER_C_ID 0x205u
#define RESONARM_ACCELEROMETER_C_DATA_ID 0x5206u
#define RESONARM_ACCELEROMETER_C_BYTES 8u
#define RESONARM_PLANT_HELLO_ID 0x206u
#define RESONARM_PLANT_HELLO_DATA_ID 0x5207u
#define RESONARM_PLANT_HELLO_BYTES 8u
#define RESONARM_EXCITER_HELLO_ID 0x207u
#define RESONARM_EXCITER_HELLO_DATA_ID 0x5208u
#define RESONARM_EXCITER_HELLO_BYTES 8u
#define RESONARM_PLANT_HEARTBEAT_ID 0x701u
#define RESONARM_PLANT_HEARTBEAT_DATA_ID 0x0000u
#define RESONARM_PLANT_HEARTBEAT_BYTES 1u
#define RESONARM_EXCITER_HEARTBEAT_ID 0x702u
#define RESONARM_EXCITER_HEARTBEAT_DATA_ID 0x0000u
#define RESONARM_EXCITER_HEARTBEAT_BYTES 1u
#define RESONARM_PLANT_EMERGENCY_ID 0x081u
#define RESONARM_PLANT_EMERGENCY_DATA_ID 0x5209u
#define RESONARM_PLANT_EMERGENCY_BYTES 8u
#define RESONARM_EXCITER_EMERGENCY_ID 0x082u
#define RESONARM_EXCITER_EMERGENCY_DATA_ID 0x520Au
#define RESONARM_EXCITER_EMERGENCY_BYTES 8u
#define RESONARM_SENSORS_ID 0x208u
#define RESONARM_SENSORS_DATA_ID 0x520Bu
#define RESONARM_SENSORS_BYTES 0u
#define RESONARM_SENSOR_PAIR_ID 0x209u
#define RESONARM_SENSOR_PAIR_DATA_ID 0x520Cu
#define RESONARM_SENSOR_PAIR_BYTES 0u
#define RESONARM_PLANT_CAPABILITIES_ID 0x20Au
#define RESONARM_PLANT_CAPABILITIES_DATA_ID 0x520Du
#define RESONARM_PLANT_CAPABILITIES_BYTES 0u
#define RESONARM_EXCITER_CAPABILITIES_ID 0x20Bu
#define RESONARM_EXCITER_CAPABILITIES_DATA_ID 0x520Eu
#define RESONARM_EXCITER_CAPABILITIES_BYTES 0u
/**@}*/

#endif
