/**
 * @file resonarm_receive_queue.h
 * @brief A queue of frames from an interrupt to the loop that passes them to the node.
 *
 * One writer, an interrupt or a thread, and one reader, the loop. Neither waits for the other, disables interrupts or
 * allocates; if the queue is full a frame is dropped and counted, and the counters of the protocol show the
 * receiver the gap. The writer must not interrupt itself: interrupts that put frames have one priority, or take turns.
 */
#ifndef RESONARM_RECEIVE_QUEUE_H
#define RESONARM_RECEIVE_QUEUE_H

#include "resonarm.h"

#ifdef __cplusplus
extern "C" {
#endif

/** The queue. Its members are private: use the functions. */
typedef struct {
    resonarm_frame *frames;
    uint32_t places;
    uint32_t written; /* The index to write next: the writer's. */
    uint32_t read;    /* The index to read next: the reader's. */
    uint32_t dropped; /* The writer's. */
} resonarm_receive_queue;

/** An empty queue in the caller's memory of `places` frames, 2 or more; it holds one frame less. */
void resonarm_receive_queue_init(resonarm_receive_queue *queue, resonarm_frame *frames, uint32_t places);
/** The writer adds a frame; false if the queue is full, and the frame is dropped. */
bool resonarm_receive_queue_put(resonarm_receive_queue *queue, const resonarm_frame *frame);
/** The reader removes the oldest frame; false if there is none. */
bool resonarm_receive_queue_take(resonarm_receive_queue *queue, resonarm_frame *frame);
/** Frames dropped so far, modulo 2^32; for the reader. */
uint32_t resonarm_receive_queue_dropped(const resonarm_receive_queue *queue);

#ifdef __cplusplus
}
#endif

#endif
