#include "axes.h"

#include "scaling.h"

const axes_coding *resonarm_axes_coding_of(resonarm_kind kind)
{
    static const axes_coding force = {{"force_x_n", "force_y_n"}, RESONARM_COUNTS_PER_N};
    static const axes_coding torque = {{"torque1_nm", "torque2_nm"}, RESONARM_COUNTS_PER_NM};
    static const axes_coding acceleration = {{"acceleration_x_m_s2", "acceleration_y_m_s2"}, RESONARM_COUNTS_PER_M_S2};
    switch (kind) {
    case RESONARM_FORCE_COMMAND:
    case RESONARM_IMPEDANCE_HEAD:
        return &force;
    case RESONARM_TORQUE_COMMAND:
        return &torque;
    case RESONARM_ACCELEROMETER_B:
    case RESONARM_ACCELEROMETER_C:
        return &acceleration;
    default:
        return NULL;
    }
}

bool resonarm_axes_are_measured(resonarm_kind kind)
{
    return kind == RESONARM_IMPEDANCE_HEAD || kind == RESONARM_ACCELEROMETER_B || kind == RESONARM_ACCELEROMETER_C;
}

axes resonarm_axes_of(const resonarm_message *message)
{
    if (message->kind == RESONARM_FORCE_COMMAND) {
        const resonarm_force_command *c = &message->content.force;
        return (axes){{c->force_x_n, c->force_y_n}, {false, false}, c->sample};
    }
    if (message->kind == RESONARM_TORQUE_COMMAND) {
        const resonarm_torque_command *c = &message->content.torque;
        return (axes){{c->torque1_nm, c->torque2_nm}, {false, false}, c->sample};
    }
    if (message->kind == RESONARM_IMPEDANCE_HEAD) {
        const resonarm_impedance_head *h = &message->content.head;
        return (axes){{h->force_x_n, h->force_y_n}, {h->x_saturated, h->y_saturated}, h->sample};
    }
    const resonarm_acceleration *a = &message->content.acceleration;
    return (axes){{a->acceleration_x_m_s2, a->acceleration_y_m_s2}, {a->x_saturated, a->y_saturated}, a->sample};
}

resonarm_message resonarm_axes_message(resonarm_kind kind, const axes *values)
{
    const double x = values->values[0], y = values->values[1];
    const bool x_saturated = values->saturated[0], y_saturated = values->saturated[1];
    resonarm_message message = {.kind = kind};
    if (kind == RESONARM_FORCE_COMMAND) {
        message.content.force = (resonarm_force_command){x, y, values->sample};
    } else if (kind == RESONARM_TORQUE_COMMAND) {
        message.content.torque = (resonarm_torque_command){x, y, values->sample};
    } else if (kind == RESONARM_IMPEDANCE_HEAD) {
        message.content.head = (resonarm_impedance_head){x, y, x_saturated, y_saturated, values->sample};
    } else {
        message.content.acceleration = (resonarm_acceleration){x, y, x_saturated, y_saturated, values->sample};
    }
    return message;
}
