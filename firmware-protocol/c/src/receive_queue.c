#include "resonarm_receive_queue.h"

/*
 * The reader sees after its acquire all that the writer wrote before a release, and the other way round. A number of
 * 32 bits must be read and written in one piece, as every processor of 32 bits does.
 */
#if !defined(RESONARM_LOAD_ACQUIRE) || !defined(RESONARM_STORE_RELEASE)
#ifdef __GNUC__
#define RESONARM_LOAD_ACQUIRE(at) __atomic_load_n((at), __ATOMIC_ACQUIRE)
#define RESONARM_STORE_RELEASE(at, value) __atomic_store_n((at), (value), __ATOMIC_RELEASE)
#else
#error "define RESONARM_LOAD_ACQUIRE(at) and RESONARM_STORE_RELEASE(at, value), of a uint32_t, for this compiler"
#endif
#endif

static uint32_t after(const resonarm_receive_queue *queue, uint32_t place)
{
    return place + 1 == queue->places ? 0 : place + 1;
}

void resonarm_receive_queue_init(resonarm_receive_queue *queue, resonarm_frame *frames, uint32_t places)
{
    *queue = (resonarm_receive_queue){.frames = frames, .places = places};
}

bool resonarm_receive_queue_put(resonarm_receive_queue *queue, const resonarm_frame *frame)
{
    const uint32_t place = queue->written;
    const uint32_t next = after(queue, place);
    if (next == RESONARM_LOAD_ACQUIRE(&queue->read)) {
        RESONARM_STORE_RELEASE(&queue->dropped, queue->dropped + 1);
        return false;
    }
    queue->frames[place] = *frame;
    RESONARM_STORE_RELEASE(&queue->written, next);
    return true;
}

bool resonarm_receive_queue_take(resonarm_receive_queue *queue, resonarm_frame *frame)
{
    const uint32_t place = queue->read;
    if (place == RESONARM_LOAD_ACQUIRE(&queue->written)) {
        return false;
    }
    *frame = queue->frames[place];
    RESONARM_STORE_RELEASE(&queue->read, after(queue, place));
    return true;
}

uint32_t resonarm_receive_queue_dropped(const resonarm_receive_queue *queue)
{
    return RESONARM_LOAD_ACQUIRE(&queue->dropped);
}
