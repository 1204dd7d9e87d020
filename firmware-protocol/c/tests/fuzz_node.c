/*
 * The fuzzer's inputs without a fuzzer: fuzz_node SEED ROUNDS FILE...
 *
 * Runs every file, and then so many rounds of each with some of its bytes changed.
 */
#include <stdio.h>

#include "../fuzz/node.c"
#include "random.h"

#define LONGEST 8192u

int main(int count, char **arguments)
{
    static uint8_t input[LONGEST], changed[LONGEST];
    if (count < 4) {
        fprintf(stderr, "usage: %s SEED ROUNDS FILE...\n", arguments[0]);
        return 2;
    }
    random_state = strtoull(arguments[1], NULL, 10) | 1u;
    const unsigned long rounds = strtoul(arguments[2], NULL, 10);
    for (int file = 3; file < count; file++) {
        FILE *stream = fopen(arguments[file], "rb");
        const size_t size = stream == NULL ? 0 : fread(input, 1, sizeof input, stream);
        if (stream == NULL || size == 0 || fclose(stream) != 0) {
            fprintf(stderr, "%s can't be read\n", arguments[file]);
            return 1;
        }
        (void)LLVMFuzzerTestOneInput(input, size);
        for (unsigned long round = 0; round < rounds; round++) {
            memcpy(changed, input, size);
            for (uint32_t change = random_word() % 8; change > 0; change--) {
                changed[random_word() % size] = (uint8_t)random_word();
            }
            (void)LLVMFuzzerTestOneInput(changed, size - random_word() % (size / 2 + 1));
        }
    }
    return 0;
}
