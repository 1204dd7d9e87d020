/** @file stm32f103.h
 * @brief The port to an STM32F103: bxCAN and SysTick, polled; 8 MHz crystal, CAN on PA11 and PA12 at 1 Mbit/s. */
#ifndef STM32F103_H
#define STM32F103_H

/** Starts clocks, CAN and time; before the first function of port.h. */
void stm32f103_start(void);

#endif
