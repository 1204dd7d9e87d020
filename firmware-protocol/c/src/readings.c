#include "readings.h"

#ifndef RESONARM_CLASSIC_ONLY

static resonarm_acceleration acceleration(const resonarm_readings *readings, resonarm_reading x, uint16_t index)
{
    return (resonarm_acceleration){
        .acceleration_x_m_s2 = readings->values[x],
        .acceleration_y_m_s2 = readings->values[x + 1],
        .x_saturated = readings->saturated[x],
        .y_saturated = readings->saturated[x + 1],
        .sample = index,
    };
}

resonarm_sample resonarm_readings_sample(const resonarm_readings *readings, uint16_t index)
{
    const resonarm_impedance_head head = {
        .force_x_n = readings->values[RESONARM_FORCE_X_N],
        .force_y_n = readings->values[RESONARM_FORCE_Y_N],
        .x_saturated = readings->saturated[RESONARM_FORCE_X_N],
        .y_saturated = readings->saturated[RESONARM_FORCE_Y_N],
        .sample = index,
    };
    return (resonarm_sample){
        .head = head,
        .b = acceleration(readings, RESONARM_ACCELERATION_B_X_M_S2, index),
        .c = acceleration(readings, RESONARM_ACCELERATION_C_X_M_S2, index),
    };
}

#endif
