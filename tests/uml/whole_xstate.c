/*
 * Preloaded into User-Mode Linux: floating point registers are set whole, however large the processor's set is.
 *
 * User-Mode Linux before 6.13 keeps the XSAVE area of a traced process in a buffer of fixed size, and sets the
 * registers from it by ptrace(PTRACE_SETREGSET, pid, NT_X86_XSTATE, &iov). A kernel whose area is larger, as on
 * processors with AMX, refuses fewer bytes with EFAULT, and User-Mode Linux dies at boot: "ptrace set fp regs failed,
 * errno = 14". PTRACE_GETREGSET accepts a shorter one.
 *
 * Here ptrace() puts the short buffer over the front of the area that the process has, and sets that. The header, which
 * says which components count, is in the front; a component behind the front, of which User-Mode Linux knows nothing,
 * stays as it is.
 *
 * User-Mode Linux sets these registers each time that a process continues, and they are mostly those that it has just
 * read from it. Then they are not set again, which spares a quarter of the time that a system call takes there.
 */
#include <elf.h>
#include <errno.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

/* Not on the stack: the stacks of User-Mode Linux have 16 KiB, the area with AMX 11 KiB. One thread traces. */
static unsigned char whole[65536] __attribute__((aligned(64)));

/* The registers that User-Mode Linux has read last: the front of the area of process `held_by`, which is 0 as soon as that
 * process may have run since. */
static unsigned char held[65536];
static size_t held_bytes;
static pid_t held_by;

static long get_xstate(pid_t pid, struct iovec *read)
{
	long result = syscall(SYS_ptrace, PTRACE_GETREGSET, pid, NT_X86_XSTATE, read);

	held_by = 0;
	if (result == 0) {
		memcpy(held, read->iov_base, read->iov_len);
		held_bytes = read->iov_len;
		held_by = pid;
	}
	return result;
}

static long set_xstate(pid_t pid, struct iovec *given)
{
	struct iovec area = { whole, sizeof whole };

	/* The read was cut to the area's length, if that is the shorter one. */
	if (held_by == pid && held_bytes <= given->iov_len && memcmp(held, given->iov_base, held_bytes) == 0)
		return 0;
	held_by = 0;
	if (syscall(SYS_ptrace, PTRACE_GETREGSET, pid, NT_X86_XSTATE, &area) == 0 && given->iov_len < area.iov_len) {
		memcpy(whole, given->iov_base, given->iov_len);
		given = &area;
	}
	return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, NT_X86_XSTATE, given);
}

/* ptrace() as the C library has it: the system call stores what a PEEK reads, the function returns it. */
long ptrace(enum __ptrace_request request, ...)
{
	va_list arguments;
	long result, read = 0;
	int peek = request == PTRACE_PEEKTEXT || request == PTRACE_PEEKDATA || request == PTRACE_PEEKUSER;

	va_start(arguments, request);
	pid_t pid = va_arg(arguments, pid_t);
	void *address = va_arg(arguments, void *);
	void *data = va_arg(arguments, void *);
	va_end(arguments);

	if (request == PTRACE_SETREGSET && address == (void *)NT_X86_XSTATE)
		return set_xstate(pid, data);
	if (request == PTRACE_GETREGSET && address == (void *)NT_X86_XSTATE)
		return get_xstate(pid, data);
	/* Any other request may let a process run. */
	if (request != PTRACE_GETREGS && request != PTRACE_SETREGS)
		held_by = 0;
	result = syscall(SYS_ptrace, request, pid, address, peek ? &read : data);
	if (peek && result == 0) {
		errno = 0;
		return read;
	}
	return result;
}
