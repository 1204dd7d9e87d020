/** @file linux_socketcan.h
 * @brief The port to Linux: a raw socket of SocketCAN, the monotonic clock, and the signals SIGINT and SIGTERM. */
#ifndef LINUX_SOCKETCAN_H
#define LINUX_SOCKETCAN_H

/** Opens an interface; 0, or the number of the error (errno). */
int linux_socketcan_open(const char *interface);

#endif
