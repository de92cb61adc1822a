#pragma once

// On this machine a parameter is looked up by its name: host.c.
struct param_s {
    const char *name;
    void *address;
};

#define PARAM_UINT8 0
#define PARAM_GROUP_START(NAME) struct param_s host_params_##NAME[] = {
#define PARAM_ADD(TYPE, NAME, ADDRESS) {#NAME, ADDRESS},
#define PARAM_GROUP_STOP(NAME) {0, 0}};
