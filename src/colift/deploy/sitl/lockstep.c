/* A simulated Betaflight in lock step with a plant: loaded before its C library (LD_PRELOAD).
 *
 * The firmware reads a clock, pauses its main loop, and talks over UDP on fixed ports. Here its clock stands until a step
 * allows it to go on, and all that it would receive and send goes over one socket that it inherits, so that any number of
 * autopilots run beside each other and each flight is repeated in every bit. Nothing of the firmware is in this file.
 *
 * A step is a `struct step`: the state of the vehicle, the sticks, and the time until when the firmware may run. Once it has,
 * it answers with a `struct answer`. Environment: COLIFT_LINK, the inherited socket; without it the clock runs by itself, for
 * the command line, whose TCP port is COLIFT_CLI_PORT.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { MOTORS_RAW = 9001, MOTORS = 9002, STATE = 9003, STICKS = 9004, CLI = 5761 };
enum { READ_NS = 500, SECOND = 1000000000 }; /* what reading the clock takes, or loops that wait for it would never end */

struct step {
    unsigned char state[144], sticks[40]; /* as the firmware's own packets */
    int64_t until;                        /* ns */
    int64_t bare;                         /* 1 for time alone: while it boots, the firmware has nowhere to put the rest */
};
struct answer {
    int64_t now; /* ns */
    float motors[4];
};

static int link_fd = -1, cli_port, state_fd = -1, sticks_fd = -1;
static pthread_t main_thread;
static _Atomic int64_t now;

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static struct step step;
static int64_t limit;
static int owed;                                    /* 1 while a step has no answer yet */
static int taken;                                   /* 1 while the thread of the state works on a step */
static enum { NONE, FRESH, TAKEN } sticks_of_step;  /* what the thread of the sticks has done of it */
static struct answer answer;

__attribute__((constructor)) static void begin(void) {
    const char *text = getenv("COLIFT_LINK"), *port = getenv("COLIFT_CLI_PORT");
    link_fd = text ? atoi(text) : -1;
    cli_port = port ? atoi(port) : 0;
    main_thread = pthread_self();
    prctl(PR_SET_PDEATHSIG, SIGKILL); /* who is left alone ends */
}

static int on_main(void) { return pthread_equal(pthread_self(), main_thread); }

static void *real(const char *name) { return dlsym(RTLD_NEXT, name); }

int clock_gettime(clockid_t clock, struct timespec *out) {
    if (clock != CLOCK_MONOTONIC) {
        return ((int (*)(clockid_t, struct timespec *))real("clock_gettime"))(clock, out);
    }
    int64_t t = on_main() ? (now += READ_NS) : now;
    t += SECOND; /* the firmware takes zero for a clock that was never read */
    out->tv_sec = t / SECOND;
    out->tv_nsec = t % SECOND;
    return 0;
}

int nanosleep(const struct timespec *pause, struct timespec *left) {
    if (on_main() && link_fd >= 0) {
        pthread_mutex_lock(&lock);
        while (now >= limit) {
            if (owed) {
                owed = 0;
                answer.now = now;
                if (send(link_fd, &answer, sizeof answer, MSG_NOSIGNAL) < 0) _exit(0);
            }
            pthread_cond_wait(&changed, &lock);
        }
        pthread_mutex_unlock(&lock);
    }
    if (on_main()) now += pause->tv_sec * (int64_t)SECOND + pause->tv_nsec;
    if (on_main() && link_fd >= 0) return 0;
    return ((int (*)(const struct timespec *, struct timespec *))real("nanosleep"))(pause, left);
}

int bind(int fd, const struct sockaddr *address, socklen_t size) {
    struct sockaddr_in own = {0};
    if (address->sa_family == AF_INET) {
        memcpy(&own, address, sizeof own);
        switch (ntohs(own.sin_port)) {
        case STATE: state_fd = fd; return 0;
        case STICKS: sticks_fd = fd; return 0;
        case CLI:
            if (link_fd >= 0) { errno = EADDRINUSE; return -1; } /* in flight nobody asks */
            own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
            own.sin_port = htons((uint16_t)cli_port);
            address = (const struct sockaddr *)&own;
            size = sizeof own;
        }
    }
    return ((int (*)(int, const struct sockaddr *, socklen_t))real("bind"))(fd, address, size);
}

ssize_t sendto(int fd, const void *data, size_t size, int flags, const struct sockaddr *address, socklen_t length) {
    if (address && address->sa_family == AF_INET) {
        int port = ntohs(((const struct sockaddr_in *)address)->sin_port);
        if (port == MOTORS && size == sizeof answer.motors) memcpy(answer.motors, data, size);
        if (port == MOTORS || port == MOTORS_RAW) return (ssize_t)size;
    }
    return ((ssize_t(*)(int, const void *, size_t, int, const struct sockaddr *, socklen_t))real("sendto"))(
        fd, data, size, flags, address, length);
}

static void release(void) {
    owed = 1;
    limit = step.until;
    pthread_cond_broadcast(&changed);
}

/* The thread of the state asks for the next step: it is through with the last one, and the firmware may run. */
static int next_state(void) {
    pthread_mutex_lock(&lock);
    if (taken) {
        while (sticks_of_step != NONE) pthread_cond_wait(&changed, &lock);
        taken = 0;
        release();
    }
    pthread_mutex_unlock(&lock);
    struct pollfd ready = {link_fd, POLLIN, 0};
    if (poll(&ready, 1, 100) != 1) return 0;
    struct step fresh;
    ssize_t got = recv(link_fd, &fresh, sizeof fresh, 0);
    if (got == 0 || (got < 0 && errno != EINTR)) _exit(0); /* the plant is gone */
    if (got != sizeof fresh) return 0;
    pthread_mutex_lock(&lock);
    step = fresh;
    taken = !fresh.bare;
    sticks_of_step = fresh.bare ? NONE : FRESH;
    if (fresh.bare) release();
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
    return taken;
}

/* That of the sticks waits until there is a step. */
static int next_sticks(void) {
    struct timespec end;
    ((int (*)(clockid_t, struct timespec *))real("clock_gettime"))(CLOCK_REALTIME, &end);
    end.tv_nsec += SECOND / 10;
    if (end.tv_nsec >= SECOND) end.tv_nsec -= SECOND, end.tv_sec += 1;
    pthread_mutex_lock(&lock);
    if (sticks_of_step == TAKEN) {
        sticks_of_step = NONE;
        pthread_cond_broadcast(&changed);
    }
    int failed = 0;
    while (sticks_of_step != FRESH && !failed) failed = pthread_cond_timedwait(&changed, &lock, &end);
    int fresh = sticks_of_step == FRESH;
    pthread_mutex_unlock(&lock);
    return fresh;
}

int select(int count, fd_set *reads, fd_set *writes, fd_set *errors, struct timeval *timeout) {
    if (link_fd >= 0 && state_fd >= 0 && count == state_fd + 1 && reads && FD_ISSET(state_fd, reads)) return next_state();
    if (link_fd >= 0 && sticks_fd >= 0 && count == sticks_fd + 1 && reads && FD_ISSET(sticks_fd, reads)) return next_sticks();
    return ((int (*)(int, fd_set *, fd_set *, fd_set *, struct timeval *))real("select"))(
        count, reads, writes, errors, timeout);
}

ssize_t recvfrom(int fd, void *data, size_t size, int flags, struct sockaddr *address, socklen_t *length) {
    if (link_fd >= 0 && fd == state_fd && size >= sizeof step.state) {
        memcpy(data, step.state, sizeof step.state);
        return sizeof step.state;
    }
    if (link_fd >= 0 && fd == sticks_fd && size >= sizeof step.sticks) {
        pthread_mutex_lock(&lock);
        memcpy(data, step.sticks, sizeof step.sticks);
        sticks_of_step = TAKEN;
        pthread_mutex_unlock(&lock);
        return sizeof step.sticks;
    }
    return ((ssize_t(*)(int, void *, size_t, int, struct sockaddr *, socklen_t *))real("recvfrom"))(
        fd, data, size, flags, address, length);
}
