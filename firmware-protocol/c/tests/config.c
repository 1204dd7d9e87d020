/* Checks that the macros of resonarm_config.h equal the values that the library computes for its network. */
#include <stdio.h>

#include "resonarm.h"

typedef struct {
    uint16_t id;
    uint16_t data_id;
    uint8_t bytes;
} row;

#define ROW(name) [RESONARM_##name] = {RESONARM_##name##_ID, RESONARM_##name##_DATA_ID, RESONARM_##name##_BYTES}

static const row rows[RESONARM_KINDS] = {
    ROW(OPERATOR_COMMAND), ROW(FORCE_COMMAND),      ROW(TORQUE_COMMAND),     ROW(IMPEDANCE_HEAD),
    ROW(ACCELEROMETER_B),  ROW(ACCELEROMETER_C),    ROW(PLANT_HELLO),        ROW(EXCITER_HELLO),
    ROW(PLANT_HEARTBEAT),  ROW(EXCITER_HEARTBEAT),  ROW(PLANT_EMERGENCY),    ROW(EXCITER_EMERGENCY),
    ROW(SENSORS),          ROW(SENSOR_PAIR),        ROW(PLANT_CAPABILITIES), ROW(EXCITER_CAPABILITIES),
};

int main(void)
{
    resonarm_network checked;
    const resonarm_network own = resonarm_own_network();
    int wrong = 0;
    if (resonarm_network_init(&checked, own.base, own.plant_id, own.exciter_id, own.profile) !=
        RESONARM_NETWORK_VALID) {
        printf("no network\n");
        wrong++;
    }
    for (int i = 0; i < RESONARM_KINDS; i++) {
        const resonarm_kind kind = (resonarm_kind)i;
        if (rows[i].id != resonarm_identifier(own, kind) || rows[i].data_id != resonarm_data_id(own, kind) ||
            rows[i].bytes != resonarm_length(own.profile, kind)) {
            printf("%s: id %#x, data id %#x, %u bytes\n", resonarm_name(kind), (unsigned)rows[i].id,
                   (unsigned)rows[i].data_id, (unsigned)rows[i].bytes);
            wrong++;
        }
    }
    return wrong == 0 ? 0 : 1;
}
