/** @file stepped_sine.h
 * @brief Two controllers: a stepped sine played open loop, and one whose force in the impedance head is held.
 *
 * Both shake along x of the base frame. They answer whole samples; time is the index of the sample. */
#ifndef STEPPED_SINE_H
#define STEPPED_SINE_H

#include "resonarm_exciter.h"

/** Most frequencies. */
#define STEPPED_SINE_POINTS 16
/** Most tries per frequency. */
#define STEPPED_SINE_TRIES 30
/** Relative tolerance of the force. */
#define STEPPED_SINE_TOLERANCE 0.003

/** The stepped sine. */
typedef struct {
    double rate_hz;                             /**< Sample rate of the plant. */
    double frequencies_hz[STEPPED_SINE_POINTS]; /**< Each above 0 and at most a twelfth of the rate. */
    size_t points;                              /**< How many. */
    double amplitude_n;                         /**< Open loop: of the command; held: of the force in the head. */
    double limit_n;                             /**< Held: the largest amplitude of the command. */
    double ramp_s;                              /**< From one amplitude to the next; open loop: at both ends. */
    double dwell_s;                             /**< Open loop: least length of a step, rounded up to whole periods. */
    double settle_s;                            /**< Held: from the end of a ramp to the reading. */
    double window_s;                            /**< Held: least length of a reading; at least 8 periods. */
} stepped_sine_spec;

/** Why it can't be played. */
typedef enum {
    STEPPED_SINE_PLAYABLE,
    STEPPED_SINE_BAD_RATE,      /**< Not in 1 to 65535 Hz. */
    STEPPED_SINE_BAD_POINTS,    /**< None, or too many. */
    STEPPED_SINE_BAD_FREQUENCY, /**< A frequency is out of range. */
    STEPPED_SINE_BAD_AMPLITUDE, /**< Amplitude or limit not in 0 to 655.34 N, or the amplitude above the limit. */
    STEPPED_SINE_BAD_TIME       /**< A time is negative or above 3600 s, or the ramps are longer than the steps. */
} stepped_sine_check;

/** Whether it can be played. */
stepped_sine_check stepped_sine_check_spec(const stepped_sine_spec *spec);

/** @name Open loop
 * Sines one after the other, each of whole periods, so that the phase is continuous, with raised-cosine ramps. */
/**@{*/
typedef struct {
    stepped_sine_spec spec;
    double starts_s[STEPPED_SINE_POINTS + 1]; /* The last is the end. */
} open_loop;

/** Prepares the controller for a checked specification. */
void open_loop_init(open_loop *controller, const stepped_sine_spec *spec);
/** A resonarm_answer_function; `context` is the open_loop. */
resonarm_answer open_loop_answer(void *context, const resonarm_sample *sample);
/**@}*/

/** @name Held
 * At each frequency the amplitude F of the force in the head is brought to the wanted one, F0: the command's amplitude
 * c is held, F is read once it has settled, and c becomes c F0/F, which is exact where the arm answers linearly. While
 * c is held there is no feedback, so no gain has to suit the arm. The reading is the fundamental over whole periods
 * under a Hann window, which suppresses an offset and other frequencies. */
/**@{*/

/** The result at a frequency. */
typedef struct {
    double frequency_hz;
    double command_n;      /**< Amplitude of the command. */
    double force_n;        /**< Amplitude of the fundamental in the head, within STEPPED_SINE_TOLERANCE. */
    int tries;             /**< From 1. */
    uint64_t first_sample; /**< First sample of the reading, counted from arming. */
    uint64_t end_sample;   /**< First sample after it. */
} held_point;

/** Why it gave up. */
typedef enum {
    HELD_NOT_GIVEN_UP,
    HELD_CLIPPED,     /**< The head was saturated while it was read. */
    HELD_LIMIT,       /**< The command would be above its limit. */
    HELD_NOT_SETTLED, /**< STEPPED_SINE_TRIES were not enough. */
    HELD_NO_FORCE     /**< The head reads no force. */
} held_reason;

/** The controller. Its members are private, except `spec`, `points`, `reached` and `reason`, which may be read. */
typedef struct {
    stepped_sine_spec spec;
    held_point points[STEPPED_SINE_POINTS];
    size_t reached; /* Points in `points`. */
    held_reason reason;
    double phase_cycles; /* Of the sine at `phase_sample`. */
    uint64_t phase_sample;
    uint64_t ramp_from; /* Sample at which the ramp begins. */
    double from_n;
    double to_n;
    int tries;
    uint64_t window_first;
    uint64_t window_end;
    uint64_t last_sample;
    bool has_gap; /* A sample of the window was lost. */
    bool is_clipped;
    double sum_cosine;
    double sum_sine;
    double sum_weight;
} held;

/** Prepares the controller for a checked specification. */
void held_init(held *controller, const stepped_sine_spec *spec);
/** A resonarm_answer_function; `context` is the held. */
resonarm_answer held_answer(void *context, const resonarm_sample *sample);
/**@}*/

#endif
