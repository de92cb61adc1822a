#pragma once

struct log_s {
    const char *name;
    const volatile void *address;
    int type;
};

#define LOG_UINT8 1
#define LOG_UINT16 2
#define LOG_GROUP_START(NAME) struct log_s host_logs_##NAME[] = {
#define LOG_ADD(TYPE, NAME, ADDRESS) {#NAME, ADDRESS, TYPE},
#define LOG_GROUP_STOP(NAME) {0, 0, 0}};
