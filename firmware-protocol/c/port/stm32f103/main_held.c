/* The reference controller on an STM32F103: a sine whose force in the impedance head is held. */
#include "held_spec.h"
#include "play.h"

int main(void)
{
    static held controller;
    held_init(&controller, &held_spec);
    return play(held_answer, &controller);
}
