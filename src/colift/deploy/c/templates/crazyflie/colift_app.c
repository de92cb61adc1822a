// colift on a Crazyflie: app and controller of one drone of a team that carries a load.
//
// Every drone decides for the whole team from what it knows and flies its own row: its own state from the firmware's estimator,
// the others' from what they tell over P2P radio, the load from the motion capture's broadcast. What all layers but attitude
// control do is done by the app's task (colift_cycle); the stabilizer's task (controllerOutOfTree) turns the drone as that wants.
// Until the flight begins, and after it was given up, the firmware's own PID controller flies.

#include "app.h"
#include "configblock.h"
#include "controller.h"
#include "controller_pid.h"
#include "FreeRTOS.h"
#include "log.h"
#include "param.h"
#include "peer_localization.h"
#include "radiolink.h"
#include "task.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "colift_steering.h"
#include "colift_turning.h"

#define PORT 5           // of our P2P messages
#define TELL_EVERY 2     // cycles from one message to the next
#define FRESH 0.2f       // age up to which what others say lets a flight begin, s
#define SILENCE 0.5f     // without the load, after which the flight is given up; age up to which others are carried on, s
#define NEAR 0.3f        // from where the mission begins, within which load and drone must be, m
#define SMOOTHING 0.02f  // time constant of the load's velocity, s
#define GRAVITY 9.81f    // of the accelerometer's unit, m/s^2
#define DEGREE 0.01745329252f
#define PERIOD_MS ((uint32_t)(COLIFT_STEER_STEP * 1000.0f + 0.5f))
#define TURN_EVERY ((uint32_t)(COLIFT_TURN_STEP * 1000.0f + 0.5f)) // the stabilizer runs at 1 kHz
// The writer of what is shared always has the higher priority: it is never interrupted by who reads.
#define FENCE() __atomic_signal_fence(__ATOMIC_SEQ_CST)

enum { WAITING, FLYING, GIVEN_UP };

// What a drone says of itself. Specific force and attitude (wxyz, body to world) as colift's signals; SI units, world frame.
typedef struct {
    float position[3], velocity[3], attitude[4], felt[3];
} body;

typedef struct {
    uint8_t number, ready;
    uint16_t count;
    body is;
} message;

_Static_assert(sizeof(message) <= P2P_MAX_DATA_SIZE, "a message fits into a packet");

static volatile struct { uint32_t count; body is; float rates[3]; } own;                          // by the stabilizer
static volatile struct { uint32_t count, at; message is; } heard[COLIFT_DRONES];                  // by the radio
static struct { float attitude[4], rates[3], turning[3], thrust; } wanted[2];                     // by the app
static volatile int front;                                                                        // what of it counts
static volatile uint8_t state = WAITING;
static setpoint_t hold; // where the drone was when the flight was given up

static colift_steering steer;
static colift_turning turn;
static volatile int cycle;
static int turns;
static struct { bool known; uint32_t at; float position[3], velocity[3]; } load;

static uint8_t fly, first = 1, load_id = 100, phase, status, silent;
static uint16_t late;

static int me(void)
{
    return (int)(configblockGetRadioAddress() & 0xFF) - first;
}

static float seconds_since(uint32_t tick)
{
    return (float)(xTaskGetTickCount() - tick) * 1e-3f;
}

static bool finite_all(const float *values, int count)
{
    for (int k = 0; k < count; ++k) {
        if (!isfinite(values[k])) {
            return false;
        }
    }
    return true;
}

static void hear(P2PPacket *packet)
{
    message said;
    if (packet->port != PORT || packet->size != sizeof said) {
        return;
    }
    memcpy(&said, packet->data, sizeof said);
    const float *q = said.is.attitude;
    const float size = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (said.number >= COLIFT_DRONES || said.number == me() || !finite_all(said.is.position, sizeof(body) / sizeof(float)) ||
        !(fabsf(size - 1.0f) < 0.1f)) {
        return;
    }
    memcpy((void *)&heard[said.number].is, &said, sizeof said);
    heard[said.number].at = xTaskGetTickCount();
    FENCE();
    ++heard[said.number].count;
}

// Copy what a task of higher priority writes; false if it did so all the time, and nothing was written yet.
static bool taken(const volatile uint32_t *count, const volatile void *from, void *to, size_t size)
{
    for (int attempt = 0; attempt < 3; ++attempt) {
        const uint32_t before = *count;
        FENCE();
        memcpy(to, (const void *)from, size);
        FENCE();
        if (before == *count) {
            return before > 0;
        }
    }
    return false;
}

static void place(int i, const body *is, float age)
{
    for (int k = 0; k < 3; ++k) {
        steer.estimated_positions[3 * i + k] = is->position[k] + age * is->velocity[k];
        steer.estimated_velocities[3 * i + k] = is->velocity[k];
        steer.measured_specific_forces[3 * i + k] = is->felt[k];
    }
    memcpy(&steer.estimated_attitudes[4 * i], is->attitude, sizeof is->attitude);
}

// The load as the motion capture sees it: its position, and a velocity that follows by a filter of second order.
static void follow_load(void)
{
    const peerLocalizationOtherPosition_t *found = peerLocalizationGetPositionByID(load_id);
    if (found == NULL) {
        return;
    }
    const point_t at = found->pos;
    const float seen[3] = {at.x, at.y, at.z};
    if ((load.known && at.timestamp == load.at) || !finite_all(seen, 3) || at.timestamp != found->pos.timestamp) {
        return;
    }
    const float dt = (float)(at.timestamp - load.at) * 1e-3f, keep = expf(-dt / SMOOTHING);
    const bool anew = !load.known || dt > SILENCE;
    for (int k = 0; k < 3; ++k) {
        const float gap = seen[k] - load.position[k] - dt * load.velocity[k];
        load.position[k] = anew ? seen[k] : seen[k] - keep * keep * gap;
        load.velocity[k] = anew ? 0.0f : load.velocity[k] + (1.0f - keep) * (1.0f - keep) / dt * gap;
    }
    load.known = true;
    load.at = at.timestamp;
}

static bool is_near(const float *found, const float *asked)
{
    const float x = found[0] - asked[0], y = found[1] - asked[1], z = found[2] - asked[2];
    return x * x + y * y + z * z < NEAR * NEAR;
}

static void give_up(const body *is)
{
    memset(&hold, 0, sizeof hold);
    hold.mode.x = hold.mode.y = hold.mode.z = hold.mode.yaw = modeAbs;
    hold.position.x = is->position[0];
    hold.position.y = is->position[1];
    hold.position.z = is->position[2];
    FENCE();
    state = GIVEN_UP;
}

static void tell(int number, const body *is, bool ready)
{
    static P2PPacket packet;
    static uint16_t count;
    if (++count % TELL_EVERY != 0) {
        return;
    }
    const message said = {(uint8_t)number, ready, count, *is};
    packet.port = PORT;
    packet.size = sizeof said;
    memcpy(packet.data, &said, sizeof said);
    radiolinkSendP2PPacketBroadcast(&packet);
}

// What the app does each time: look, decide, tell the others.
void colift_cycle(void)
{
    const int number = me();
    body is;
    float rates[3];
    if (number < 0 || number >= COLIFT_DRONES || !taken(&own.count, &own.is, &is, sizeof is) ||
        !taken(&own.count, own.rates, rates, sizeof rates)) {
        return;
    }
    follow_load();
    const bool tracked = load.known && seconds_since(load.at) < SILENCE;
    bool ready = fly && tracked;
    if (state == WAITING) { // steer holds where the mission begins
        ready = ready && is_near(is.position, &steer.estimated_positions[3 * number]) && is_near(load.position, steer.estimated_load);
    }
    bool all = ready;
    silent = 0;
    for (int j = 0; j < COLIFT_DRONES; ++j) {
        message said;
        if (j == number) {
            continue;
        }
        const bool told = taken(&heard[j].count, &heard[j].is, &said, sizeof said);
        const float age = told ? seconds_since(heard[j].at) : SILENCE;
        all = all && told && said.ready && age < FRESH;
        silent = (uint8_t)(silent + (age >= SILENCE));
        if (told && state == FLYING) {
            place(j, &said.is, fminf(age, SILENCE));
        }
    }
    tell(number, &is, ready);
    if (state == WAITING && all) {
        state = FLYING;
    } else if (state == FLYING && !ready) {
        give_up(&is);
    } else if (state == GIVEN_UP && !fly) { // begins anew where the mission begins, and nowhere else
        colift_steering_start(&steer);
        colift_turning_start(&turn);
        cycle = 0;
        turns = 0;
        load.known = false;
        state = WAITING;
    }
    if (state != FLYING) {
        return;
    }
    place(number, &is, 0.0f);
    for (int k = 0; k < 3; ++k) {
        steer.estimated_rates[3 * number + k] = rates[k];
        steer.estimated_load[k] = load.position[k] + seconds_since(load.at) * load.velocity[k];
        steer.estimated_load[3 + k] = load.velocity[k];
    }
    colift_steer(&steer, cycle);
    const int back = 1 - front;
    memcpy(wanted[back].attitude, &steer.desired_attitudes[4 * number], sizeof wanted[back].attitude);
    memcpy(wanted[back].rates, &steer.desired_rates[3 * number], sizeof wanted[back].rates);
    memcpy(wanted[back].turning, &steer.desired_turning[3 * number], sizeof wanted[back].turning);
    wanted[back].thrust = steer.thrusts[number];
    FENCE();
    front = back;
    FENCE();
    ++cycle; // from now on the stabilizer may look
    phase = (uint8_t)steer.phase[0];
    status = (uint8_t)steer.status;
}

void appMain(void)
{
    p2pRegisterCB(hear);
    TickType_t last = xTaskGetTickCount();
    for (;;) {
        vTaskDelayUntil(&last, M2T(PERIOD_MS));
        late = (uint16_t)(late + (xTaskGetTickCount() - last > PERIOD_MS));
        colift_cycle();
    }
}

void controllerOutOfTreeInit(void)
{
    controllerPidInit();
    colift_steering_start(&steer);
    colift_turning_start(&turn);
}

bool controllerOutOfTreeTest(void)
{
    return controllerPidTest();
}

static void keep(const sensorData_t *sensors, const state_t *now)
{
    const quaternion_t *q = &now->attitudeQuaternion;
    const body is = {
        {now->position.x, now->position.y, now->position.z},
        {now->velocity.x, now->velocity.y, now->velocity.z},
        {q->w, q->x, q->y, q->z},
        {GRAVITY * sensors->acc.x, GRAVITY * sensors->acc.y, GRAVITY * sensors->acc.z},
    };
    const float rates[3] = {DEGREE * sensors->gyro.x, DEGREE * sensors->gyro.y, DEGREE * sensors->gyro.z};
    if (!finite_all(is.position, sizeof is / sizeof(float)) || !finite_all(rates, 3)) {
        return;
    }
    memcpy((void *)&own.is, &is, sizeof is);
    memcpy((void *)own.rates, rates, sizeof rates);
    FENCE();
    ++own.count;
}

void controllerOutOfTree(
    control_t *control, const setpoint_t *setpoint, const sensorData_t *sensors, const state_t *now, const stabilizerStep_t step)
{
    static float torques[3], thrust;
    keep(sensors, now);
    const int number = me();
    if (state != FLYING || cycle == 0) {
        controllerPid(control, state == GIVEN_UP ? &hold : setpoint, sensors, now, step);
        return;
    }
    if (step % TURN_EVERY == 0 || turns == 0) {
        const int k = front;
        memcpy(&turn.estimated_attitudes[4 * number], (const void *)own.is.attitude, sizeof own.is.attitude);
        memcpy(&turn.estimated_rates[3 * number], (const void *)own.rates, sizeof own.rates);
        memcpy(&turn.desired_attitudes[4 * number], wanted[k].attitude, sizeof wanted[k].attitude);
        memcpy(&turn.desired_rates[3 * number], wanted[k].rates, sizeof wanted[k].rates);
        memcpy(&turn.desired_turning[3 * number], wanted[k].turning, sizeof wanted[k].turning);
        colift_turn(&turn, turns++);
        memcpy(torques, &turn.torques[3 * number], sizeof torques);
        thrust = wanted[k].thrust;
    }
    if (!isfinite(thrust) || !finite_all(torques, 3)) {
        give_up((const body *)&own.is);
        controllerPid(control, &hold, sensors, now, step);
        return;
    }
    control->controlMode = controlModeForceTorque;
    control->thrustSi = thrust;
    memcpy(control->torque, torques, sizeof torques);
}

PARAM_GROUP_START(colift)
PARAM_ADD(PARAM_UINT8, fly, &fly)
PARAM_ADD(PARAM_UINT8, first, &first)
PARAM_ADD(PARAM_UINT8, load, &load_id)
PARAM_GROUP_STOP(colift)

LOG_GROUP_START(colift)
LOG_ADD(LOG_UINT8, state, &state)
LOG_ADD(LOG_UINT8, phase, &phase)
LOG_ADD(LOG_UINT8, status, &status)
LOG_ADD(LOG_UINT8, silent, &silent)
LOG_ADD(LOG_UINT16, late, &late)
LOG_GROUP_STOP(colift)
