/*
 * hold_registers BYTE SWITCHES: fills ymm0 and ymm15 with BYTE, gives the processor away SWITCHES times, and looks at
 * them after each: they must be as they were, whatever other processes have in theirs. Exit status: 0 if so, else 1.
 */
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>

__attribute__((target("avx"))) int main(int count, char **arguments)
{
	unsigned char filled[32], found0[32], found15[32];
	long switches = count == 3 ? strtol(arguments[2], NULL, 10) : 0;

	if (switches < 1)
		return 2;
	memset(filled, atoi(arguments[1]), sizeof filled);
	while (switches-- > 0) {
		long result = SYS_sched_yield;

		__asm__ volatile("vmovdqu %[filled], %%ymm0\n\tvmovdqu %[filled], %%ymm15\n\tsyscall\n\t"
				 "vmovdqu %%ymm0, %[found0]\n\tvmovdqu %%ymm15, %[found15]"
				 : [found0] "=m"(found0), [found15] "=m"(found15), "+a"(result)
				 : [filled] "m"(filled)
				 : "rcx", "r11", "xmm0", "xmm15", "memory");
		if (memcmp(filled, found0, sizeof filled) != 0 || memcmp(filled, found15, sizeof filled) != 0)
			return 1;
	}
	return 0;
}
