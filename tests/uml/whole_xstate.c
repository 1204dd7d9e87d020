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

static long set_xstate(pid_t pid, struct iovec *given)
{
	struct iovec area = { whole, sizeof whole };
	long result;

	if (syscall(SYS_ptrace, PTRACE_GETREGSET, pid, NT_X86_XSTATE, &area) == 0 && given->iov_len < area.iov_len) {
		memcpy(whole, given->iov_base, given->iov_len);
		result = syscall(SYS_ptrace, PTRACE_SETREGSET, pid, NT_X86_XSTATE, &area);
	} else {
		result = syscall(SYS_ptrace, PTRACE_SETREGSET, pid, NT_X86_XSTATE, given);
	}
	return result;
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
	result = syscall(SYS_ptrace, request, pid, address, peek ? &read : data);
	if (peek && result == 0) {
		errno = 0;
		return read;
	}
	return result;
}
