// The firmware around the app, on this machine: one drone, driven from outside a millisecond at a time.

#include "configblock.h"
#include "controller.h"
#include "controller_pid.h"
#include "log.h"
#include "param.h"
#include "peer_localization.h"
#include "radiolink.h"
#include "task.h"

#include <setjmp.h>
#include <stddef.h>
#include <string.h>

void appMain(void);
extern struct param_s host_params_colift[];
extern struct log_s host_logs_colift[];

static uint32_t tick, pid_calls;
static uint8_t number;
static jmp_buf started;
static P2PCallback hear;
static P2PPacket sent;
static bool has_sent;
static peerLocalizationOtherPosition_t load;

TickType_t xTaskGetTickCount(void) { return tick; }
uint64_t configblockGetRadioAddress(void) { return 0xE7E7E7E700u + number; }
void p2pRegisterCB(P2PCallback callback) { hear = callback; }
void vTaskDelayUntil(TickType_t *last, TickType_t time) { *last += time; longjmp(started, 1); } // the task is left where it first waits
void controllerPidInit(void) {}
bool controllerPidTest(void) { return true; }

peerLocalizationOtherPosition_t *peerLocalizationGetPositionByID(uint8_t id)
{
    return load.id != 0 && id == load.id ? &load : NULL;
}

bool radiolinkSendP2PPacketBroadcast(P2PPacket *packet)
{
    sent = *packet;
    return has_sent = true;
}

// The firmware's own controller, whose only answer is that it was asked, and where to.
void controllerPid(control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *state, const stabilizerStep_t step)
{
    (void)sensors, (void)state, (void)step;
    ++pid_calls;
    memset(control, 0, sizeof *control);
    control->controlMode = controlModeLegacy;
    control->torque[0] = setpoint->position.x;
}

void host_begin(int id)
{
    number = (uint8_t)id;
    controllerOutOfTreeInit();
    if (setjmp(started) == 0) {
        appMain();
    }
}

// state: position, velocity, attitude wxyz, specific force (m/s^2), rates (rad/s); wanted: mode, thrust, torque.
void host_stabilize(uint32_t now, const float *state, float *wanted)
{
    const float g = 9.81f, degrees = 57.29577951f;
    static const setpoint_t nothing;
    sensorData_t sensors = {{state[10] / g, state[11] / g, state[12] / g}, {degrees * state[13], degrees * state[14], degrees * state[15]}};
    state_t is = {.position = {now, state[0], state[1], state[2]}, .velocity = {now, state[3], state[4], state[5]}};
    is.attitudeQuaternion = (quaternion_t){.w = state[6], .x = state[7], .y = state[8], .z = state[9]};
    control_t control = {0};
    tick = now;
    controllerOutOfTree(&control, &nothing, &sensors, &is, now);
    wanted[0] = (float)control.controlMode;
    wanted[1] = control.thrustSi;
    memcpy(wanted + 2, control.torque, sizeof control.torque);
}

void host_track(int id, float x, float y, float z)
{
    load.id = (uint8_t)id;
    load.pos = (point_t){tick, x, y, z};
}

void host_hear(const uint8_t *packet)
{
    P2PPacket copy;
    memcpy(&copy, packet, sizeof copy);
    hear(&copy);
}

int host_said(uint8_t *packet) // its size, and 0 if nothing is new
{
    memcpy(packet, &sent, sizeof sent);
    const int size = has_sent ? (int)sizeof sent : 0;
    has_sent = false;
    return size;
}

int host_set(const char *name, int value)
{
    for (struct param_s *each = host_params_colift; each->name != NULL; ++each) {
        if (strcmp(each->name, name) == 0) {
            *(uint8_t *)each->address = (uint8_t)value;
            return 1;
        }
    }
    return 0;
}

int host_log(const char *name)
{
    for (struct log_s *each = host_logs_colift; each->name != NULL; ++each) {
        if (strcmp(each->name, name) == 0) {
            return each->type == LOG_UINT8 ? *(const volatile uint8_t *)each->address : *(const volatile uint16_t *)each->address;
        }
    }
    return -1;
}
