/** @file zephyr_can.h
 * @brief The port to Zephyr: its CAN API, and its uptime as the clock. */
#ifndef ZEPHYR_CAN_H
#define ZEPHYR_CAN_H

#include <zephyr/device.h>

/** Starts a CAN controller and receives all of its frames; 0, or a negative error (errno) of Zephyr. */
int zephyr_can_open(const struct device *controller);
/** Lets loop_run() leave the bus and return. */
void zephyr_can_stop(void);

#endif
