#include "play.h"

#include "loop.h"

#define PATIENCE_NS UINT64_C(3600000000000)

int play(resonarm_answer_function answer, void *context)
{
    static resonarm_exciter exciter;
    const resonarm_exciter_config config = {
        .network = resonarm_own_network(),
        .rate_hz = 1000,
        .timing = resonarm_lockstep(),
        .answer = answer,
        .context = context,
    };
    resonarm_exciter_init(&exciter, &config);
    return loop_run(&exciter, PATIENCE_NS) == LOOP_ENDED ? 0 : 1;
}
