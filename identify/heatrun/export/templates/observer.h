
/* Observer: a Kalman filter of the nodes and of heat that the network misses, corrected by one
 * sensor. It judges the sensor by what the model expects, and goes on without it where it fails. */
#define HEATRUN_NUM_HEATS $num_heats
#define HEATRUN_HAS_LAG $has_lag /* the reading is a state of its own */
#define HEATRUN_NUM_STATES (HEATRUN_NUM_NODES + HEATRUN_NUM_HEATS + 5 + HEATRUN_HAS_LAG)
#define HEATRUN_NUM_COVARIANCES ((HEATRUN_NUM_STATES - 4)*(HEATRUN_NUM_STATES + 5)/2)
#ifndef HEATRUN_READING_SD_K /* set these three for the sensor of the drive */
#define HEATRUN_READING_SD_K $reading_sd /* white noise of one reading, rounding included */
#endif
#ifndef HEATRUN_SLOW_SD_K
#define HEATRUN_SLOW_SD_K $slow_sd /* its slow noise */
#endif
#ifndef HEATRUN_SENSOR_SD_K
#define HEATRUN_SENSOR_SD_K $sensor_sd /* its constant error */
#endif
#ifndef HEATRUN_MOMENT_STEPS /* standard deviation of its moment against that of the inputs: */
#define HEATRUN_MOMENT_STEPS 0.29 /* one comes from anywhere in a step of the other */
#endif
/* False alarms, on a machine that is as the run has it: the mean makes less than 0.2 in 1000 h. */
#define HEATRUN_OFF_SDS 5.0       /* a reading, its jump, or the mean of what readings and model */
#define HEATRUN_MEAN_STEPS 300    /* differ by over so many, is suspect beyond so many sds; */
#define HEATRUN_HEAT_SDS 4.0      /* so is one that is followed by so many sds of wrong heat; */
#define HEATRUN_OFF_STEPS 10      /* it counts no more after so many, four sound ones undo one */
#define HEATRUN_STUCK_K $stuck    /* the model has moved so far by itself, beyond three sds
                                   * of what wrong heat makes, while the reading stayed the same */
#define HEATRUN_AGREE_SDS 2.0     /* it agrees while its mean is nearer than so many sds, and */
#define HEATRUN_RECOVERY_STEPS 30 /* counts again after so many readings, */
#define HEATRUN_PROOF_STEPS 1800  /* or after these where the model did not change much meanwhile */
#define HEATRUN_PROVEN_STEPS 300  /* after so many good ones the model, too, is known to be right */
#define HEATRUN_LOST_STEPS 60     /* without a reading */

typedef enum {
    HEATRUN_SENSOR_OK = 0,
    HEATRUN_SENSOR_LOST = 1,       /* no reading for long: NaN or beyond the limits */
    HEATRUN_SENSOR_STUCK = 2,
    HEATRUN_SENSOR_OFF = 3,        /* it jumps as no machine does */
    HEATRUN_SENSOR_RECOVERING = 4, /* it agrees again, and is not used yet */
    HEATRUN_SENSOR_DISAGREES = 5,  /* with the model: sensor, inputs or machine are not as they were */
    HEATRUN_SENSOR_WAITING = 6     /* no reading in this step: pass NaN when there is no new one */
} heatrun_sensor;

typedef struct {
    heatrun_real mean;
    heatrun_real with_late; /* covariance with late_K */
} heatrun_followed;

typedef struct {
    heatrun_state model;
    heatrun_real heat_W[HEATRUN_NUM_HEATS];
    heatrun_real slow_K; /* error of the sensor */
#if HEATRUN_HAS_LAG
    heatrun_real shown_degC; /* what the sensor has come to */
#endif
    heatrun_real covariance[HEATRUN_NUM_COVARIANCES]; /* lower triangle, without constants' own */
    heatrun_real change_K;      /* of what is read, by the model, in this step */
    heatrun_real last_change_K; /* and in that of the last reading */
    heatrun_real last_degC; /* reading, */
    heatrun_real changed_K; /* and how far the model has gone since */
    heatrun_real jump_K;    /* of the last reading, more than the model, */
    heatrun_real jump_K2;   /* and the variance of that */
    heatrun_real apart_K;   /* mean of readings less model over a few */
    heatrun_real late_K;    /* change that a sensor that lags has not yet shown; */
    heatrun_followed late;   /* over many, that, */
    heatrun_followed apart;  /* readings less model, */
    heatrun_followed prompt; /* what a change that is not known well makes of them, */
    heatrun_followed stays;  /* and the standard deviation of what stays, */
    heatrun_real mean_K2;    /* and its variance */
    heatrun_real jumped_K;  /* largest jump of a suspect reading that the model does not know */
    heatrun_real moved_K;   /* by itself, since the reading stays the same, */
    heatrun_real pushed_K;  /* and by what may be wrong with the heat */
    heatrun_real fresh_K;   /* change that the node has not yet passed on */
    heatrun_real swing_K;   /* change while it agreed, the latest foremost */
    heatrun_real doubt_K;   /* how far apart they have been, slowly forgotten */
    int score; /* four for a suspect reading, -1 for another */
    int num_good;
    int num_missing; /* readings */
    int is_proven;
    int is_own;       /* the last jump: more of the reading than of the model */
    int has_moved;    /* while it agreed */
    int has_returned; /* by its last jump */
    heatrun_sensor belief; /* OK, STUCK or DISAGREES */
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

