mod arm;
mod textbook;
