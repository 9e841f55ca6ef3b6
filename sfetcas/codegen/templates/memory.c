/* The next so many numbers of the memory. */
static double *sf_numbers(double **next, size_t count) {
  double *found = *next;
  *next += count;
  return found;
}

static int *sf_wholes(int **next, size_t count) {
  int *found = *next;
  *next += count;
  return found;
}

/* What factors with pivots of the matrix need. */
static void sf_lend(sf_factors *factors, sf_pivoted *pivoted, double **numbers, int **whole) {
  factors->n = pivoted->n = SF_TOTAL;
  factors->start = pivoted->start = sf_start_of_columns;
  factors->row = pivoted->row = sf_rows;
#if SF_ROOM
  pivoted->order = sf_order_with_pivots;
  pivoted->room = SF_ROOM;
  pivoted->lower_value = sf_numbers(numbers, SF_ROOM);
  pivoted->upper_value = sf_numbers(numbers, SF_ROOM);
  pivoted->pivot = sf_numbers(numbers, SF_TOTAL);
  pivoted->x = sf_numbers(numbers, SF_TOTAL);
  pivoted->lower_row = sf_wholes(whole, SF_ROOM);
  pivoted->upper_row = sf_wholes(whole, SF_ROOM);
  pivoted->place = sf_wholes(whole, SF_TOTAL);
  pivoted->row_of = sf_wholes(whole, SF_TOTAL);
  pivoted->mark = sf_wholes(whole, SF_TOTAL);
  pivoted->reached = sf_wholes(whole, SF_TOTAL);
  pivoted->stack = sf_wholes(whole, SF_TOTAL);
  pivoted->at = sf_wholes(whole, SF_TOTAL);
  pivoted->lower = sf_wholes(whole, SF_TOTAL + 1);
  pivoted->upper = sf_wholes(whole, SF_TOTAL + 1);
#else
  (void)numbers;
  (void)whole;
#endif
}

/* Where results at a state are. */
static void sf_lend_point(const sf_model *model, int results, sf_point *point, double **numbers) {
  point->result = sf_numbers(numbers, (size_t)results);
  point->place = sf_numbers(numbers, (size_t)(model->places * model->axes));
  point->pull = sf_numbers(numbers, (size_t)(model->elements * model->points * model->axes));
  point->work = sf_numbers(numbers, (size_t)sf_work_size(model));
}

