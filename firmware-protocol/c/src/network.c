#include "resonarm.h"

/* The table of section 1: a kind's name, the low byte of its data id, its sender, its length in each profile. */
typedef struct {
    const char *name;
    uint8_t data_id;
    uint8_t lengths[2];
    resonarm_node sender;
} kind_row;

static const kind_row kinds[RESONARM_KINDS] = {
    {"OperatorCommand", 0x01, {8, 8}, RESONARM_EXCITER},
    {"ForceCommand", 0x02, {8, 16}, RESONARM_EXCITER},
    {"TorqueCommand", 0x03, {8, 16}, RESONARM_EXCITER},
    {"ImpedanceHead", 0x04, {8, 0}, RESONARM_PLANT},
    {"AccelerometerB", 0x05, {8, 0}, RESONARM_PLANT},
    {"AccelerometerC", 0x06, {8, 0}, RESONARM_PLANT},
    {"PlantHello", 0x07, {8, 8}, RESONARM_PLANT},
    {"ExciterHello", 0x08, {8, 8}, RESONARM_EXCITER},
    {"PlantHeartbeat", 0, {1, 1}, RESONARM_PLANT},
    {"ExciterHeartbeat", 0, {1, 1}, RESONARM_EXCITER},
    {"PlantEmergency", 0x09, {8, 8}, RESONARM_PLANT},
    {"ExciterEmergency", 0x0A, {8, 8}, RESONARM_EXCITER},
    {"Sensors", 0x0B, {0, 32}, RESONARM_PLANT},
    {"SensorPair", 0x0C, {0, 64}, RESONARM_PLANT},
    {"PlantCapabilities", 0x0D, {0, 16}, RESONARM_PLANT},
    {"ExciterCapabilities", 0x0E, {0, 16}, RESONARM_EXCITER},
};

#ifdef RESONARM_CLASSIC_ONLY
typedef char the_profile_of_the_config_is_built[RESONARM_PROFILE == RESONARM_PROFILE_CLASSIC ? 1 : -1];
#endif

/* Whether the library supports the profile. */
static bool is_built(resonarm_profile profile)
{
#ifdef RESONARM_CLASSIC_ONLY
    return profile == RESONARM_PROFILE_CLASSIC;
#else
    return profile == RESONARM_PROFILE_CLASSIC || profile == RESONARM_PROFILE_FD;
#endif
}

static bool is_node_id(uint8_t id)
{
    return id >= 1 && id <= RESONARM_NODE_ID_MAX;
}

resonarm_network_check resonarm_network_init(
    resonarm_network *network, uint16_t base, uint8_t plant_id, uint8_t exciter_id, resonarm_profile profile)
{
    if (base < RESONARM_BASE_MIN || base > RESONARM_BASE_MAX) {
        return RESONARM_BASE_OUT_OF_RANGE;
    }
    if (base % 0x10 != 0) {
        return RESONARM_BASE_UNALIGNED;
    }
    if (!is_node_id(plant_id) || !is_node_id(exciter_id)) {
        return RESONARM_NODE_ID_OUT_OF_RANGE;
    }
    if (plant_id == exciter_id) {
        return RESONARM_SAME_NODE_ID;
    }
    if (!is_built(profile)) {
        return RESONARM_PROFILE_NOT_BUILT;
    }
    *network = (resonarm_network){base, plant_id, exciter_id, profile};
    return RESONARM_NETWORK_VALID;
}

resonarm_network resonarm_own_network(void)
{
    return (resonarm_network){RESONARM_BASE, RESONARM_PLANT_ID, RESONARM_EXCITER_ID, RESONARM_PROFILE};
}

resonarm_node resonarm_sender(resonarm_kind kind)
{
    return kinds[kind].sender;
}

uint16_t resonarm_identifier(resonarm_network network, resonarm_kind kind)
{
    const unsigned node = resonarm_sender(kind) == RESONARM_PLANT ? network.plant_id : network.exciter_id;
    switch (kind) {
    case RESONARM_PLANT_HEARTBEAT:
    case RESONARM_EXCITER_HEARTBEAT:
        return (uint16_t)(0x700u + node);
    case RESONARM_PLANT_EMERGENCY:
    case RESONARM_EXCITER_EMERGENCY:
        return (uint16_t)(0x080u + node);
    case RESONARM_SENSORS:
    case RESONARM_SENSOR_PAIR:
    case RESONARM_PLANT_CAPABILITIES:
    case RESONARM_EXCITER_CAPABILITIES:
        return (uint16_t)(network.base + 8u + (unsigned)kind - RESONARM_SENSORS);
    default:
        return (uint16_t)(network.base + (unsigned)kind);
    }
}

uint16_t resonarm_data_id(resonarm_network network, resonarm_kind kind)
{
    const unsigned number = kinds[kind].data_id;
    return (uint16_t)(number == 0 ? 0 : (0x51u + network.plant_id) << 8 | number);
}

uint8_t resonarm_length(resonarm_profile profile, resonarm_kind kind)
{
    return is_built(profile) ? kinds[kind].lengths[profile] : 0;
}

resonarm_frame_format resonarm_format(resonarm_profile profile, resonarm_kind kind)
{
    return resonarm_length(profile, kind) > 8 ? RESONARM_FRAME_FD : RESONARM_FRAME_CLASSIC;
}

const char *resonarm_name(resonarm_kind kind)
{
    return kinds[kind].name;
}
