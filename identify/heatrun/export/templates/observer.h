
/* Observer: a Kalman filter of the nodes and of heat that the network misses, corrected by one
 * sensor. It judges the sensor by what the model expects, and goes on without it where it fails. */
#define HEATRUN_NUM_HEATS $num_heats
#define HEATRUN_HAS_LAG $has_lag /* the reading is a state of its own */
#define HEATRUN_NUM_STATES (HEATRUN_NUM_NODES + HEATRUN_NUM_HEATS + 5 + HEATRUN_HAS_LAG)
#ifndef HEATRUN_READING_SD_K /* set these three for the sensor of the drive */
#define HEATRUN_READING_SD_K $reading_sd /* white noise of one reading, rounding included */
#endif
#ifndef HEATRUN_SLOW_SD_K
#define HEATRUN_SLOW_SD_K $slow_sd /* its slow noise */
#endif
#ifndef HEATRUN_SENSOR_SD_K
#define HEATRUN_SENSOR_SD_K $sensor_sd /* its constant error */
#endif
#define HEATRUN_OFF_SDS 5.0       /* a reading, or its jump, is suspect beyond so many sds; */
#define HEATRUN_OFF_STEPS 10      /* the sensor is off after so many, four sound ones undo one */
#define HEATRUN_STUCK_K $stuck    /* the model has moved so far by itself, beyond three sds
                                   * of what wrong heat makes, while the reading stayed the same */
#define HEATRUN_RECOVERY_STEPS 30 /* good readings on end before the sensor counts again */

typedef enum {
    HEATRUN_SENSOR_OK = 0,
    HEATRUN_SENSOR_LOST = 1,      /* NaN or beyond its limits; pass NaN when a reading is late */
    HEATRUN_SENSOR_STUCK = 2,
    HEATRUN_SENSOR_OFF = 3,
    HEATRUN_SENSOR_RECOVERING = 4 /* it agrees again, and is not used yet */
} heatrun_sensor;

typedef struct {
    heatrun_state model;
    heatrun_real heat_W[HEATRUN_NUM_HEATS];
    heatrun_real slow_K; /* error of the sensor */
#if HEATRUN_HAS_LAG
    heatrun_real shown_degC; /* what the sensor has come to */
#endif
    heatrun_real covariance[HEATRUN_NUM_STATES*(HEATRUN_NUM_STATES + 1)/2]; /* lower triangle */
    heatrun_real last_degC;
    heatrun_real moved_K; /* by itself, since the reading stays the same, */
    heatrun_real pushed_K; /* and by what may be wrong with the heat */
    heatrun_real fresh_K; /* change that the node has not yet passed on */
    int score; /* four for a suspect reading, -1 for another */
    int num_good;
    heatrun_sensor sensor;
} heatrun_observer;

typedef struct {
    heatrun_real temperature_degC[HEATRUN_NUM_NODES];
    heatrun_real sd_K[HEATRUN_NUM_NODES]; /* standard deviation */
    heatrun_status status;                /* of inputs and state; sd_K grows while it is not OK */
    heatrun_sensor sensor;                /* unless OK, the temperatures are those of the model */
} heatrun_estimate;

/* Start from a guess with its standard deviation, from 0 to 300 K; an invalid one changes
 * nothing. */
heatrun_status heatrun_observer_start(heatrun_observer *observer,
                                      const heatrun_real temperature_degC[HEATRUN_NUM_NODES],
                                      heatrun_real sd_K);

/* Advance by HEATRUN_STEP_S, and take the reading at the end of the step [degC]. */
heatrun_estimate heatrun_observer_step(heatrun_observer *observer, const heatrun_inputs *inputs,
                                       heatrun_real reading_degC);

