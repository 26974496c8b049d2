/* heatrun export: replays vectors, prints the largest differences and which line differs first
 *
 *   cc -std=c99 -O2 -o replay main.c thermal_network.c
 *   ./replay vectors.csv observer_vectors.csv
 *   ./replay --write observer_vectors.csv > other.csv    with what this build makes of the inputs
 *
 * Exit status 0 where all are within their limits, for temperatures 1e-6 K (double) or 0.05 K
 * (float), else 1. A row at time 0 holds a start: the temperatures, for an observer with one sd.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "thermal_network.h"

#define NUM_INPUTS (3 + HEATRUN_HAS_SECOND_SINK + HEATRUN_HAS_COOLANT + HEATRUN_HAS_SPEED \
                    + HEATRUN_HAS_FAN)
#define NUM_MODEL (1 + NUM_INPUTS + HEATRUN_NUM_NODES)
#ifdef HEATRUN_NUM_STATES
#define NUM_ASKED 4 /* of an observer: reading; node, limit and horizon, node -1 for no question */
#define NUM_OBSERVER (1 + NUM_INPUTS + NUM_ASKED + 2*HEATRUN_NUM_NODES + 4)
#define MOST_COLUMNS NUM_OBSERVER
#else
#define MOST_COLUMNS NUM_MODEL
#endif

#ifndef HEATRUN_NUM_STATES
typedef struct {
    heatrun_state model;
} heatrun_observer; /* there is none */
#endif

/* Return how many numbers a line begins with. */
static int read_row(const char *line, double row[MOST_COLUMNS])
{
    int i;
    for (i = 0; i < MOST_COLUMNS; ++i) {
        char *end;
        row[i] = strtod(line, &end);
        if (end == line) {
            break;
        }
        line = *end == ',' ? end + 1 : end;
    }
    return i;
}

static heatrun_inputs inputs_of(const double *next)
{
    heatrun_inputs inputs;
    inputs.current_A = (heatrun_real)*next++;
    inputs.losses_W = (heatrun_real)*next++;
    inputs.sink_degC = (heatrun_real)*next++;
#if HEATRUN_HAS_SECOND_SINK
    inputs.second_sink_degC = (heatrun_real)*next++;
#endif
#if HEATRUN_HAS_COOLANT
    inputs.coolant_degC = (heatrun_real)*next++;
#endif
#if HEATRUN_HAS_SPEED
    inputs.speed_rpm = (heatrun_real)*next++;
#endif
#if HEATRUN_HAS_FAN
    inputs.fan = (heatrun_real)*next++;
#endif
    (void)next;
    return inputs;
}

/* Replace the temperatures of a row by those of the model. */
static heatrun_status follow(heatrun_observer *at, double row[NUM_MODEL])
{
    double *found = row + 1 + NUM_INPUTS;
    const heatrun_inputs inputs = inputs_of(row + 1);
    heatrun_real start[HEATRUN_NUM_NODES];
    heatrun_status status;
    int i;
    for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
        start[i] = (heatrun_real)found[i];
    }
    status = row[0] > 0.0 ? heatrun_step(&at->model, &inputs) : heatrun_start(&at->model, start);
    for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
        found[i] = (double)at->model.temperature_degC[i];
    }
    return status;
}

#ifdef HEATRUN_NUM_STATES
/* Replace the outputs of a row by those of the observer. */
static heatrun_status observe(heatrun_observer *at, double row[NUM_OBSERVER])
{
    const double *asked = row + 1 + NUM_INPUTS;
    double *found = row + 1 + NUM_INPUTS + NUM_ASKED;
    const heatrun_inputs inputs = inputs_of(row + 1);
    heatrun_estimate now;
    int i;
    if (!(row[0] > 0.0)) {
        heatrun_real start[HEATRUN_NUM_NODES];
        for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
            start[i] = (heatrun_real)found[2*i];
        }
        return heatrun_observer_start(at, start, (heatrun_real)found[1]);
    }
    now = heatrun_observer_step(at, &inputs, (heatrun_real)asked[0]);
    for (i = 0; i < HEATRUN_NUM_NODES; ++i) {
        *found++ = (double)now.temperature_degC[i];
        *found++ = (double)now.sd_K[i];
    }
    *found++ = (double)now.status;
    *found++ = (double)now.sensor;
    *found++ = (double)heatrun_time_to_limit_s(&at->model, &inputs, (int)asked[1],
                                               (heatrun_real)asked[2], (heatrun_real)asked[3]);
    *found = (double)heatrun_permitted_current_A(&at->model, &inputs, (int)asked[1],
                                                 (heatrun_real)asked[2], (heatrun_real)asked[3]);
    return HEATRUN_OK; /* what it says of inputs is an output */
}
#endif

static const char *name_of(const char *heading, int column)
{
    for (; column > 0; --column) {
        heading += strcspn(heading, ",");
        heading += *heading == ',' ? 1 : 0;
    }
    return heading;
}

/* Difference that a column may have, by the unit at the end of its name. */
static double limit_of(const char *name)
{
    const int is_float = sizeof(heatrun_real) < 8;
    const size_t length = strcspn(name, ",\r\n");
    const char *unit = length > 2 ? name + length - 2 : "";
    return strncmp(unit, "_A", 2) == 0 ? (is_float ? 1e-3 : 1e-5)*HEATRUN_MAX_CURRENT_A
        : strncmp(unit, "_s", 2) == 0  ? (is_float ? 5.5 : 1.5)*HEATRUN_STEP_S
                                       : (is_float ? 0.05 : 1e-6);
}

static int replay(const char *file_name, int is_writing)
{
    static char line[4096], heading[4096];
    FILE *file = fopen(file_name, "r");
    heatrun_observer at;
    double largest_K = 0.0;
    long num_steps = 0, num_line = 0;
    int num_inputs = 1 + NUM_INPUTS, num_columns = NUM_MODEL, is_close = 1;
    heatrun_status status = HEATRUN_OK;
    if (file == NULL) {
        fprintf(stderr, "%s cannot be read\n", file_name);
        return 2;
    }
    while (status == HEATRUN_OK && fgets(line, (int)sizeof line, file) != NULL) {
        double expected[MOST_COLUMNS], found[MOST_COLUMNS] = {0.0};
        int i;
        ++num_line;
        if (strncmp(line, "time_s,", 7) == 0) {
            strcpy(heading, line);
#ifdef HEATRUN_NUM_STATES
            if (strstr(line, ",reading_degC,") != NULL) {
                num_inputs = 1 + NUM_INPUTS + NUM_ASKED;
                num_columns = NUM_OBSERVER;
            }
#endif
        }
        if (read_row(line, expected) != num_columns) {
            fputs(is_writing ? line : "", stdout);
            continue; /* comments and the heading */
        }
        memcpy(found, expected, sizeof found);
#ifdef HEATRUN_NUM_STATES
        status = num_columns == NUM_OBSERVER ? observe(&at, found) : follow(&at, found);
#else
        status = follow(&at, found);
#endif
        num_steps += expected[0] > 0.0 ? 1 : 0;
        for (i = 0; is_writing && i < num_columns; ++i) {
            printf("%.12g%c", found[i], i + 1 < num_columns ? ',' : '\n');
        }
        for (i = num_inputs; !is_writing && i < num_columns; ++i) {
            const char *name = name_of(heading, i);
            const double error = found[i] - expected[i];
            const double size = error < 0.0 ? -error : error;
            const int is_K = (i - num_inputs)/(num_columns == NUM_MODEL ? 1 : 2) < HEATRUN_NUM_NODES;
            largest_K = is_K && size > largest_K ? size : largest_K;
            if (is_close && !(size <= limit_of(name))) { /* NaN too */
                printf("%s, line %ld: %.*s is %.9g, expected %.9g (limit %.3g)\n", file_name,
                       num_line, (int)strcspn(name, ",\r\n"), name, found[i], expected[i],
                       limit_of(name));
                is_close = 0;
            }
        }
    }
    fclose(file);
    if (status != HEATRUN_OK) {
        fprintf(stderr, "%s, line %ld: status %d\n", file_name, num_line, (int)status);
    } else if (!is_writing) {
        printf("%s: %ld steps of %g s, largest difference %.3g K (limit %g K)\n", file_name,
               num_steps, (double)HEATRUN_STEP_S, largest_K, limit_of("_degC"));
    }
    return status == HEATRUN_OK && num_steps > 0 && is_close ? 0 : 1;
}

int main(int num_words, char **words)
{
    const int is_writing = num_words > 1 && strcmp(words[1], "--write") == 0;
    int i, status = 0;
    if (num_words < 2 + is_writing) {
        fprintf(stderr, "usage: replay [--write] FILE...\n");
        return 2;
    }
    for (i = 1 + is_writing; i < num_words; ++i) {
        const int of_file = replay(words[i], is_writing);
        status = of_file > status ? of_file : status;
    }
    return status;
}
