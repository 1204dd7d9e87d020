/*
 * set_part_of_xstate BYTES: sets the first BYTES of the XSAVE area of a child, as User-Mode Linux does with its buffer,
 * and prints the result. With BYTES shorter than the area, every processor shows the error that User-Mode Linux meets
 * on a processor with AMX.
 *
 * The child fills ymm0, stops, and reports ymm0 when it resumes. Its lower half, xmm0, is at byte 160 of the
 * area, its upper half at 576, behind the legacy region (512 bytes) and the header (64). The parent sets xmm0 anew in
 * between.
 * Prints `area AREA bytes, set: OUTCOME`, and if it was set `xmm0 OLD→NEW, upper half VALUE`, as bytes of the child.
 */
#include <elf.h>
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

enum { XMM0 = 160, CHILD_BYTE = 0x11, PARENT_BYTE = 0x22 };

static void fail(const char *what)
{
	perror(what);
	exit(2);
}

/* Writes the 32 bytes of ymm0 into the pipe. No library between the registers filled and read: it would use them. */
__attribute__((target("avx"))) static void child(int pipe_end)
{
	unsigned char filled[32], found[32];
	long stopped = SYS_kill, self = getpid();

	memset(filled, CHILD_BYTE, sizeof filled);
	if (ptrace(PTRACE_TRACEME, 0, 0, 0) != 0)
		fail("PTRACE_TRACEME");
	__asm__ volatile("vmovdqu %[filled], %%ymm0\n\tsyscall\n\tvmovdqu %%ymm0, %[found]"
			 : [found] "=m"(found), "+a"(stopped)
			 : [filled] "m"(filled), "D"(self), "S"((long)SIGSTOP)
			 : "rcx", "r11", "xmm0", "memory");
	if (write(pipe_end, found, sizeof found) != sizeof found)
		fail("write");
	_exit(0);
}

int main(int count, char **arguments)
{
	static unsigned char area[65536] __attribute__((aligned(64)));
	struct iovec all = { area, sizeof area }, part = { area, count == 2 ? strtoul(arguments[1], NULL, 10) : 0 };
	unsigned char found[32];
	int ends[2], status;
	pid_t pid;

	if (pipe(ends) != 0)
		fail("pipe");
	pid = fork();
	if (pid == 0)
		child(ends[1]);
	if (pid < 0 || waitpid(pid, &status, 0) != pid || !WIFSTOPPED(status))
		fail("child");
	if (ptrace(PTRACE_GETREGSET, pid, NT_X86_XSTATE, &all) != 0)
		fail("PTRACE_GETREGSET");
	memset(area + XMM0, PARENT_BYTE, 16);
	if (part.iov_len > 0 && part.iov_len < all.iov_len)
		memset(area + part.iov_len, 0xff, all.iov_len - part.iov_len); /* the bytes after BYTES must not be used */
	if (ptrace(PTRACE_SETREGSET, pid, NT_X86_XSTATE, &part) != 0) {
		printf("area %zu bytes, set: errno %d\n", all.iov_len, errno);
		ptrace(PTRACE_KILL, pid, 0, 0);
		return 1;
	}
	if (ptrace(PTRACE_CONT, pid, 0, 0) != 0 || read(ends[0], found, sizeof found) != sizeof found)
		fail("PTRACE_CONT");
	printf("area %zu bytes, set: done, xmm0 %02x %02x, upper half %02x %02x\n", all.iov_len, found[0], found[15],
	       found[16], found[31]);
	return 0;
}
