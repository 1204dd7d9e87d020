#include "resonarm.h"

/* A row of the table of section 5. */
typedef struct {
    resonarm_state from;
    resonarm_event event;
    resonarm_state to;
} transition;

static const transition transitions[] = {
    {RESONARM_BOOT_UP, RESONARM_EVENT_STARTED, RESONARM_PRE_OPERATIONAL},
    {RESONARM_BOOT_UP, RESONARM_EVENT_FAULT, RESONARM_FAULT},
    {RESONARM_PRE_OPERATIONAL, RESONARM_EVENT_ARM, RESONARM_OPERATIONAL},
    {RESONARM_PRE_OPERATIONAL, RESONARM_EVENT_FAULT, RESONARM_FAULT},
    {RESONARM_OPERATIONAL, RESONARM_EVENT_DISARM, RESONARM_PRE_OPERATIONAL},
    {RESONARM_OPERATIONAL, RESONARM_EVENT_FAULT, RESONARM_FAULT},
    {RESONARM_FAULT, RESONARM_EVENT_RESET, RESONARM_PRE_OPERATIONAL},
};

resonarm_state resonarm_next_state(resonarm_state state, resonarm_event event)
{
    for (size_t i = 0; i < sizeof transitions / sizeof transitions[0]; i++) {
        if (transitions[i].from == state && transitions[i].event == event) {
            return transitions[i].to;
        }
    }
    return state;
}
