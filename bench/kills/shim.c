/* Preloaded: ends a process, or fails a call, at the n-th call that changes a file below a folder.
 *
 * shim_arm(folder, n, action) begins to count; actions are a signal's number (sent before the call), or -errno (the
 * call fails so; ENOSPC then fails every further call that needs space). shim_count() tells the calls so far. While
 * armed, fsync only counts: what a dead process wrote is there without it, and campaigns have thousands of them.
 * A program that is started with SHIM_BELOW, SHIM_AT and SHIM_ACTION in its environment is armed from its beginning.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

enum { FILES = 1024 };

static char below[PATH_MAX];
static long at, count;
static int action;
static unsigned char ours[FILES];

void shim_arm(const char *folder, long n, int what);
long shim_count(void);

void shim_arm(const char *folder, long n, int what)
{
    (void)snprintf(below, sizeof below, "%s", folder);
    at = n;
    action = what;
    count = 0;
    memset(ours, 0, sizeof ours);
}

long shim_count(void)
{
    return count;
}

__attribute__((constructor)) static void arm_from_environment(void)
{
    const char *folder = getenv("SHIM_BELOW");
    const char *n = getenv("SHIM_AT");
    const char *what = getenv("SHIM_ACTION");
    if (folder != NULL && n != NULL && what != NULL) {
        shim_arm(folder, atol(n), atoi(what));
    }
}

static int is_ours(int dir, const char *path)
{
    if (below[0] == '\0') {
        return 0;
    }
    if (path[0] == '/') {
        return strncmp(path, below, strlen(below)) == 0;
    }
    return dir >= 0 && dir < FILES && ours[dir] != 0;
}

static int fd_is_ours(int fd)
{
    return fd >= 0 && fd < FILES && ours[fd] != 0;
}

/* Whether the call fails (errno is set). */
static int fails(int mine, int needs_space)
{
    if (!mine) {
        return 0;
    }
    count++;
    if (count == at && action > 0) {
        (void)kill(getpid(), action);
    }
    if (action < 0 && (count == at || (at > 0 && count > at && action == -ENOSPC && needs_space)) &&
        (needs_space || action != -ENOSPC)) {
        errno = -action;
        return 1;
    }
    return 0;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int opened(int fd, int mine)
{
    if (fd >= 0 && fd < FILES) {
        ours[fd] = (unsigned char)mine;
    }
    return fd;
}

#define OPEN(name)                                                                           \
    int name(const char *path, int flags, ...)                                               \
    {                                                                                        \
        va_list more;                                                                        \
        mode_t mode;                                                                         \
        int mine = is_ours(AT_FDCWD, path);                                                  \
        va_start(more, flags);                                                               \
        mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;                            \
        va_end(more);                                                                        \
        if ((flags & O_ACCMODE) != O_RDONLY && fails(mine, 1)) {                             \
            return -1;                                                                       \
        }                                                                                    \
        return opened(REAL(name)(path, flags, mode), mine);                                  \
    }

#define OPENAT(name)                                                                         \
    int name(int dir, const char *path, int flags, ...)                                      \
    {                                                                                        \
        va_list more;                                                                        \
        mode_t mode;                                                                         \
        int mine = is_ours(dir, path);                                                       \
        va_start(more, flags);                                                               \
        mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;                            \
        va_end(more);                                                                        \
        if ((flags & O_ACCMODE) != O_RDONLY && fails(mine, 1)) {                             \
            return -1;                                                                       \
        }                                                                                    \
        return opened(REAL(name)(dir, path, flags, mode), mine);                             \
    }

OPEN(open)
OPEN(open64)
OPENAT(openat)
OPENAT(openat64)

ssize_t write(int fd, const void *data, size_t size)
{
    return fails(fd_is_ours(fd), 1) ? -1 : REAL(write)(fd, data, size);
}

ssize_t pwrite64(int fd, const void *data, size_t size, off64_t offset)
{
    return fails(fd_is_ours(fd), 1) ? -1 : REAL(pwrite64)(fd, data, size, offset);
}

ssize_t pwrite(int fd, const void *data, size_t size, off_t offset)
{
    return fails(fd_is_ours(fd), 1) ? -1 : REAL(pwrite)(fd, data, size, offset);
}

int fsync(int fd)
{
    if (fails(fd_is_ours(fd), 1)) {
        return -1;
    }
    return fd_is_ours(fd) ? 0 : REAL(fsync)(fd);
}

int close(int fd)
{
    int mine = fd_is_ours(fd);
    if (fails(mine, 0)) {
        (void)opened(fd, 0);
        (void)REAL(close)(fd); /* Linux closes also where it tells an error */
        errno = -action;
        return -1;
    }
    (void)opened(fd, 0);
    return REAL(close)(fd);
}

int rename(const char *from, const char *to)
{
    return fails(is_ours(AT_FDCWD, from), 1) ? -1 : REAL(rename)(from, to);
}

int renameat2(int from_dir, const char *from, int to_dir, const char *to, unsigned int flags)
{
    if (getenv("SHIM_NO_EXCHANGE") != NULL && flags != 0U) {
        errno = EINVAL;
        return -1;
    }
    return fails(is_ours(from_dir, from), 1) ? -1 : REAL(renameat2)(from_dir, from, to_dir, to, flags);
}

int unlink(const char *path)
{
    return fails(is_ours(AT_FDCWD, path), 0) ? -1 : REAL(unlink)(path);
}

int unlinkat(int dir, const char *path, int flags)
{
    return fails(is_ours(dir, path), 0) ? -1 : REAL(unlinkat)(dir, path, flags);
}

int rmdir(const char *path)
{
    return fails(is_ours(AT_FDCWD, path), 0) ? -1 : REAL(rmdir)(path);
}

int mkdir(const char *path, mode_t mode)
{
    return fails(is_ours(AT_FDCWD, path), 1) ? -1 : REAL(mkdir)(path, mode);
}

/* A file system as FAT: no hard links, no symbolic ones. */
static int without_links(void)
{
    errno = EPERM;
    return getenv("SHIM_NO_LINKS") != NULL;
}

int link(const char *from, const char *to)
{
    if (without_links()) {
        return -1;
    }
    return fails(is_ours(AT_FDCWD, to), 1) ? -1 : REAL(link)(from, to);
}

int linkat(int from_dir, const char *from, int to_dir, const char *to, int flags)
{
    if (without_links()) {
        return -1;
    }
    return fails(is_ours(to_dir, to), 1) ? -1 : REAL(linkat)(from_dir, from, to_dir, to, flags);
}

int symlink(const char *to, const char *path)
{
    if (without_links()) {
        return -1;
    }
    return fails(is_ours(AT_FDCWD, path), 1) ? -1 : REAL(symlink)(to, path);
}

int ftruncate64(int fd, off64_t size)
{
    return fails(fd_is_ours(fd), 1) ? -1 : REAL(ftruncate64)(fd, size);
}
